"""The operator's side: lines and a status line on stderr, keys from a terminal or a pipe."""

import os
import sys
import termios
import threading
import tty
from asyncio import AbstractEventLoop
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Console:
    """Lines on stderr; on a terminal also a last line that is rewritten."""

    def __init__(self) -> None:
        """Looks once whether stderr is a terminal."""
        self._terminal = sys.stderr.isatty()
        self._status = ""

    def say(self, words: str) -> None:
        """One line that stays."""
        clear = "\r\x1b[K" if self._status else ""
        _write(f"{clear}{words}\n{self._line()}")

    def status(self, words: Callable[[], str]) -> None:
        """Rewrite the last line; without a terminal nobody asks for the words."""
        if self._terminal:
            self._status = words()
            _write(f"\r\x1b[K{self._line()}")

    def _line(self) -> str:
        return self._status[: os.get_terminal_size(sys.stderr.fileno()).columns - 1] if self._status else ""


def _write(text: str) -> None:
    """All at once: several threads have something to say."""
    sys.stderr.write(text)
    sys.stderr.flush()


@contextmanager
def typed(loop: AbstractEventLoop, press: Callable[[str], None]) -> Iterator[None]:
    """While inside, give what comes from stdin to `press` in the loop: key by key from a terminal, else as it comes.

    The end of stdin means only that no more keys come: a bridge that runs without an operator goes on.
    """

    def read() -> None:
        while text := os.read(sys.stdin.fileno(), 1024):
            loop.call_soon_threadsafe(press, text.decode(errors="replace"))

    with _single_keys():
        # A daemon: it may wait for a key for ever, and nothing needs it at the end.
        threading.Thread(target=read, daemon=True).start()
        yield


@contextmanager
def _single_keys() -> Iterator[None]:
    if not sys.stdin.isatty():
        yield
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
