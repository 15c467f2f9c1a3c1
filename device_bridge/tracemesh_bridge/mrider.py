"""`mrider.txt`, written by the Android app of the thesis's author (bbrrck/sensor-fusion, 2017): made into a recording.

    MORPHORIDER NETWORK
    CURVE  1  0                      boundary, closed (1 or 0 each)
    SEGMENT                          a node; the curve's first and last sample are nodes, too
         1498651234567  tx ty tz  nx ny nz       ms since 1970, two unit vectors

Two traps. The nodes have no numbers: the file does not know where curves meet. And the app keeps the inverse of its
quaternion, so that its two vectors are not the phone's y and z in the world, but the world's North and Up in the phone:
lying flat with the top to the West it writes (1, 0, 0) where the tangent is (-1, 0, 0).
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from tracemesh.wire.base import Vector
from tracemesh.wire.device import MAX_SAMPLES, CurveEnd, CurveStart, Device, Hello, NodeMark, Recorded, Samples
from tracemesh_bridge.errors import BridgeError

FIRST_LINE = "MORPHORIDER NETWORK"
UNIT_TOLERANCE = 1e-3
_Row = tuple[float, Vector, Vector]


@dataclass
class _Curve:
    boundary: bool
    closed: bool
    nodes: list[int] = field(default_factory=list)
    rows: list[_Row] = field(default_factory=list)


def read_mrider(
    lines: Iterable[str], recording: str, transposed: bool, nodes: Sequence[Sequence[int]] = ()
) -> list[str]:
    """The file's recording, one JSON message a line.

    transposed: the vectors are North and Up in the phone. nodes: numbers of the nodes along each curve; a curve without
    gets new ones. Raises BridgeError that names the line or curve at fault.
    """
    curves = [c for c in _curves(lines, transposed) if c.rows]
    hello = Hello(recording=recording, device=Device(id="mrider", kind="mrider"))
    numbers = list(_numbers(curves, nodes))
    messages: list[Recorded] = []
    for index, (curve, names) in enumerate(zip(curves, numbers, strict=True)):
        messages.extend(_messages(curve, index, names, len(messages)))
    return [m.model_dump_json(exclude_none=True) for m in (hello, *messages)]


def turned(tangent: Vector, normal: Vector) -> tuple[Vector, Vector]:
    """The phone's y and z in the world, of the world's y and z in the phone: rows of the matrix given by columns."""
    (a, b, c), (d, e, f) = tangent, normal
    x = (b * f - c * e, c * d - a * f, a * e - b * d)
    return (x[1], tangent[1], normal[1]), (x[2], tangent[2], normal[2])


def _curves(lines: Iterable[str], transposed: bool) -> Iterator[_Curve]:
    curve: _Curve | None = None
    begun = False
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        if not begun:
            begun = _check(line.strip() == FIRST_LINE, number, FIRST_LINE, line)
        elif words[0] == "CURVE":
            if curve is not None:
                yield curve
            _check(len(words) == 3 and set(words[1:]) <= {"0", "1"}, number, "CURVE and two of 0 or 1", line)
            curve = _Curve(words[1] == "1", words[2] == "1")
        elif curve is None:
            _check(False, number, "CURVE", line)
        elif words[0] == "SEGMENT":
            curve.nodes.append(len(curve.rows))
        else:
            curve.rows.append(_row(words, number, line, transposed))
    _check(begun, 1, FIRST_LINE, "nothing")
    if curve is not None:
        yield curve


def _row(words: list[str], number: int, line: str, transposed: bool) -> _Row:
    try:
        time, *v = (float(word) for word in words)
    except ValueError:
        v = []
    tangent, normal = tuple(v[:3]), tuple(v[3:])
    units = all(len(u) == 3 and abs(math.hypot(*u) - 1.0) < UNIT_TOLERANCE for u in (tangent, normal))
    _check(units and math.isfinite(time), number, "a time in ms and two unit vectors", line)
    (a, b, c), (d, e, f) = tangent, normal
    frame = turned((a, b, c), (d, e, f)) if transposed else ((a, b, c), (d, e, f))
    return (time / 1000.0, *frame)


def _check(good: bool, number: int, wanted: str, line: str) -> bool:
    if not good:
        raise BridgeError(f"line {number}: wanted {wanted}, got {line.strip()[:60]!r}")
    return True


def _marks(curve: _Curve) -> list[int]:
    """Samples at which the curve has nodes: where a segment begins, and at both ends."""
    last = len(curve.rows) - 1
    return sorted({0, *(min(n, last) for n in curve.nodes), last})


def _numbers(curves: Sequence[_Curve], given: Sequence[Sequence[int]]) -> Iterator[Sequence[int]]:
    if len(given) > len(curves):
        raise BridgeError(f"wanted numbers for at most {len(curves)} curves, got {len(given)}")
    free = 1 + max((n for numbers in given for n in numbers), default=-1)
    for index, curve in enumerate(curves):
        count = len(_marks(curve))
        if index >= len(given):
            yield range(free, free + count)
            free += count
        elif len(given[index]) != count:
            raise BridgeError(f"curve {index}: wanted numbers for its {count} nodes, got {len(given[index])}")
        else:
            yield given[index]


def _messages(curve: _Curve, index: int, nodes: Sequence[int], first: int) -> Iterator[Recorded]:
    yield CurveStart(seq=first, curve=index, boundary=curve.boundary)
    seq = first + 1
    for start in range(0, len(curve.rows), MAX_SAMPLES):
        time, tangent, normal = (list(column) for column in zip(*curve.rows[start : start + MAX_SAMPLES], strict=True))
        yield Samples(seq=seq, curve=index, first_sample=start, time=time, tangent=tangent, normal=normal)
        seq += 1
    for sample, node in zip(_marks(curve), nodes, strict=True):
        yield NodeMark(seq=seq, curve=index, sample=sample, node=node)
        seq += 1
    yield CurveEnd(seq=seq, curve=index, closed=curve.closed)
