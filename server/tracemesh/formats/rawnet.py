"""rawnet: the thesis's text format of a scanned curve network (code snippet 5.6); described in docs/formats.md."""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from tracemesh.errors import InputError, ScanError
from tracemesh.geometry.scan import CurveScan, Floats, Ints, Scan

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_COLUMNS = 7
_ROW = " ".join(["%+.8f"] * _COLUMNS)
_UNIT_TOLERANCE = 0.05  # files carry as few as four decimals


def read_rawnet(text: str, source: str = "") -> Scan:
    """Scan held by a rawnet text; raises InputError that names `source`, line and curve, what was wanted and what came.

    Samples outside the first and the last node of an open curve are dropped; a curve with one node has it at both ends;
    the only curve of a network, closed and without nodes, gets node 0 at both ends.
    """
    lines = _Lines(text, source)
    count = lines.integer("the number of curves", 0)
    if count == 0:
        raise lines.error(
            "a first line of 0 announces a list of .rawcurve files, which is not supported: "
            "wanted all curves in one file"
        )
    curves = []
    for number in range(1, count + 1):
        lines.where = f"curve {number} of {count}"
        curves.append(_read_curve(lines, alone=count == 1))
    lines.where = ""
    lines.expect_end(count)
    return Scan(tuple(curves))


def write_rawnet(scan: Scan) -> str:
    """Text of which `read_rawnet` makes the same scan, numbers to 8 decimals; vectors and times have no place in it.

    Raises ScanError where the format would say something else: a curve with exactly one marked sample.
    """
    parts = [f"{len(scan.curves)}  # number of curves"]
    for number, curve in enumerate(scan.curves, 1):
        if len(curve.node_samples) == 1:
            raise ScanError(f"curve {number}: rawnet holds curves with no node or at least two marked samples, got one")
        parts += [f"# curve {number}", *_header(curve), *_rows(curve)]
    return "\n".join(parts) + "\n"


class _Lines:
    """The lines that say something, with their numbers; turns every fault into an InputError that says where."""

    def __init__(self, text: str, source: str) -> None:
        stripped = (line.split("#", 1)[0].strip() for line in text.removeprefix("\ufeff").splitlines())
        self._lines = [(number, line) for number, line in enumerate(stripped, 1) if line]
        self._next = 0
        self._source = source
        self.where = ""

    @property
    def line(self) -> int:
        """Number of the line that was taken last."""
        return self._lines[self._next - 1][0] if self._next else 1

    def error(self, message: str, line: int | None = None) -> InputError:
        parts = (self._source, f"line {line or self.line}", self.where, message)
        return InputError(": ".join(part for part in parts if part))

    def take(self, what: str) -> str:
        if self._next == len(self._lines):
            last = self._lines[-1][0] if self._lines else 1
            raise self.error(f"wanted {what}, but the file ends here", last)
        self._next += 1
        return self._lines[self._next - 1][1]

    def integers(self, what: str, count: int, lowest: int, highest: int | None = None) -> list[int]:
        """The next line's integers, each checked."""
        words = self.take(what).split()
        if len(words) != count:
            raise self.error(f"wanted {what} ({count} on this line), got {len(words)}: {_shown(' '.join(words))}")
        for word in words:
            if not _INTEGER.fullmatch(word) or not lowest <= int(word) or (highest is not None and int(word) > highest):
                span = (
                    f"an integer of at least {lowest}" if highest is None else f"an integer from {lowest} to {highest}"
                )
                raise self.error(f"wanted {what}: {span}, got {_shown(word)}")
        return [int(word) for word in words]

    def integer(self, what: str, lowest: int, highest: int | None = None) -> int:
        return self.integers(what, 1, lowest, highest)[0]

    def table(self, rows: int) -> Floats:
        """The next `rows` lines as numbers, (rows, 7)."""
        block = self._lines[self._next : self._next + rows]
        values = _numbers([line for _, line in block])
        if values.shape != (rows, _COLUMNS) or not np.isfinite(values).all():
            raise self._table_error(block, rows)
        self._next += rows
        return values

    def _table_error(self, block: Sequence[tuple[int, str]], rows: int) -> InputError:
        wanted = "7 numbers: distance, tangent x y z, normal x y z"
        for row, (number, line) in enumerate(block, 1):
            words = line.split()
            if len(words) != _COLUMNS:
                return self.error(f"sample {row} of {rows}: wanted {wanted}, got {len(words)}: {_shown(line)}", number)
            for word in words:
                if not _is_finite_number(word):
                    return self.error(f"sample {row} of {rows}: wanted a finite number, got {_shown(word)}", number)
        last = self._lines[-1][0]
        return self.error(f"wanted {rows} samples, but the file ends after {len(block)}", last)

    def line_of_row(self, row: int, rows: int) -> int:
        """Line number of a row of the table that was read last."""
        return self._lines[self._next - rows + row][0]

    def expect_end(self, count: int) -> None:
        if self._next < len(self._lines):
            line = self.take("nothing")
            raise self.error(f"wanted nothing after the {count} curves announced on top, got {_shown(line)}")


def _read_curve(lines: _Lines, alone: bool) -> CurveScan:
    boundary = bool(lines.integer("1 (boundary) or 0 (interior)", 0, 1))
    closed = bool(lines.integer("1 (closed) or 0 (open)", 0, 1))
    marks = lines.integer("the number of nodes", 0)
    local = lines.integers("local node indices", marks, 1) if marks else []
    line_of_local = lines.line
    if any(b <= a for a, b in pairwise(local)):
        raise lines.error(f"wanted local node indices that increase, got {_shown(' '.join(map(str, local)))}")
    ids = lines.integers("global node indices", marks, 0) if marks else []
    if closed and marks > 1 and ids[0] != ids[-1]:
        raise lines.error(f"a closed curve ends at the node where it began: wanted node {ids[0]} last, got {ids[-1]}")
    count = lines.integer("the number of samples", 2)
    if local and local[-1] > count:
        message = f"local node index {local[-1]} is out of range: wanted 1 to {count}, the number of samples"
        raise lines.error(message, line_of_local)
    table = lines.table(count)
    _check_units(lines, table)
    if marks == 1 or (marks == 0 and closed and alone):
        local, ids = [1, count], (ids or [0]) * 2
    return _curve(table, np.array(local, np.int64) - 1, np.array(ids, np.int64), boundary, closed)


def _check_units(lines: _Lines, table: Floats) -> None:
    for name, columns in (("tangent", slice(1, 4)), ("normal", slice(4, 7))):
        norms = np.linalg.norm(table[:, columns], axis=1)
        wrong = np.flatnonzero(np.abs(norms - 1) > _UNIT_TOLERANCE)
        if len(wrong):
            line = lines.line_of_row(int(wrong[0]), len(table))
            raise lines.error(f"wanted a {name} of length 1, got one of length {norms[wrong[0]]:.4g}", line)


def _curve(table: Floats, local: Ints, ids: Ints, boundary: bool, closed: bool) -> CurveScan:
    if len(local) and not closed:
        table, local = table[local[0] : local[-1] + 1], local - local[0]
    distance, tangent, normal = table[:, 0].copy(), table[:, 1:4].copy(), table[:, 4:7].copy()
    return CurveScan(distance, tangent, normal, local, ids, boundary=boundary, closed=closed)


def _header(curve: CurveScan) -> Iterator[str]:
    yield f"{int(curve.boundary)}  # 1 boundary, 0 interior"
    yield f"{int(curve.closed)}  # 1 closed, 0 open"
    yield f"{len(curve.node_samples)}  # number of nodes"
    if len(curve.node_samples):
        yield " ".join(str(sample + 1) for sample in curve.node_samples) + "  # local"
        yield " ".join(map(str, curve.node_ids)) + "  # global"
    yield f"{len(curve.distance)}  # number of samples: distance, tangent, normal"


def _rows(curve: CurveScan) -> Iterator[str]:
    table = np.column_stack([curve.distance, curve.tangent, curve.normal])
    return (_ROW % tuple(row) for row in table.tolist())


def _numbers(lines: list[str]) -> Floats:
    """Lines of numbers as a table; empty when they are none."""
    try:
        return np.loadtxt(lines, ndmin=2) if lines else np.empty((0, 0))
    except ValueError:
        return np.empty((0, 0))


def _is_finite_number(word: str) -> bool:
    return bool(_NUMBER.fullmatch(word)) and bool(np.isfinite(float(word)))


def _shown(text: str) -> str:
    """Input quoted in a message, not more than a line of it."""
    return repr(text if len(text) <= 60 else text[:57] + "...")
