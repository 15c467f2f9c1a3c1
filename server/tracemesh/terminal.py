"""What a person at a terminal sees while work goes on."""

import sys
from time import monotonic
from types import TracebackType
from typing import TextIO


class ProgressLine:
    """One line on a terminal that shows stage and percentage once the work has taken over a second; callable.

    Writes nothing when the stream is not a terminal.
    """

    DELAY = 1.0
    """s, how long work may take before it is worth a word."""

    def __init__(self, stream: TextIO = sys.stderr) -> None:
        """Show progress on `stream`."""
        self._stream = stream
        self._begin = monotonic()
        self._shown = False

    def __call__(self, stage: str, fraction: float) -> None:
        """Show the stage in words and the fraction done, 0 to 1."""
        if not self._stream.isatty() or monotonic() - self._begin < self.DELAY:
            return
        self._shown = True
        self._stream.write(f"\r\x1b[2K{stage} {fraction:4.0%}")
        self._stream.flush()

    def __enter__(self) -> "ProgressLine":
        """Begin."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Clear the line."""
        if self._shown:
            self._stream.write("\r\x1b[2K")
            self._stream.flush()
