"""What the operator's keys mean: one grammar for a terminal, a numpad and a pipe.

    -  start a boundary curve            .      end the curve (open)
    +  start an interior curve           * c    end the curve (closed: back where it began)
    digits Enter  mark that node now     / u    take back: the digits being typed, else the last mark
    x  throw the current curve away      q      end the curve, send everything, quit
    ?  show these keys

Thesis section 5.2.1 gives `-`, `+` and the node numbers; numbers end with Enter because networks have more than ten
nodes: type ahead, press Enter while passing the node. Everything but letters is on a numpad.
"""

from collections.abc import Iterator
from dataclasses import dataclass

KEYS_HELP = (
    "keys: - boundary curve, + interior curve, digits Enter = node, . end open, * end closed, / undo, x discard, q quit"
)
MAX_DIGITS = 6


@dataclass(frozen=True)
class StartCurve:
    """Begin a curve."""

    boundary: bool


@dataclass(frozen=True)
class EndCurve:
    """End the current curve."""

    closed: bool


@dataclass(frozen=True)
class MarkNode:
    """The device passes this node now."""

    node: int


@dataclass(frozen=True)
class Undo:
    """Take back the last mark."""


@dataclass(frozen=True)
class Discard:
    """Throw the current curve away."""


@dataclass(frozen=True)
class Quit:
    """Send everything and stop."""


@dataclass(frozen=True)
class Help:
    """Show the keys."""


@dataclass(frozen=True)
class Unknown:
    """A key without a meaning."""

    key: str


Command = StartCurve | EndCurve | MarkNode | Undo | Discard | Quit | Help | Unknown

_COMMANDS: dict[str, Command] = {
    "-": StartCurve(boundary=True),
    "+": StartCurve(boundary=False),
    ".": EndCurve(closed=False),
    "*": EndCurve(closed=True),
    "c": EndCurve(closed=True),
    "x": Discard(),
    "q": Quit(),
    "?": Help(),
}
_UNDO = "/u\x7f\x08"


class KeyParser:
    """Turns characters into commands; remembers only the digits being typed."""

    def __init__(self) -> None:
        """Nothing typed yet."""
        self.digits = ""

    def feed(self, text: str) -> Iterator[Command]:
        """The commands that these characters complete. Enter without digits means nothing."""
        for key in text:
            if key in "0123456789" and len(self.digits) < MAX_DIGITS:
                self.digits += key
            elif key in "\r\n":
                yield from self._enter()
            elif key in _UNDO:
                yield from self._undo()
            elif not key.isspace():
                self.digits = ""
                yield _COMMANDS.get(key, Unknown(key))

    def _enter(self) -> Iterator[Command]:
        if self.digits:
            digits, self.digits = self.digits, ""
            yield MarkNode(int(digits))

    def _undo(self) -> Iterator[Command]:
        if self.digits:
            self.digits = ""
        else:
            yield Undo()
