"""Cleaned curves cut to their nodes: what begins and ends where, before anything is resampled."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.cleaning import CleanCurve
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.rotations import align_signs
from tracemesh.geometry.scan import curve_name

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_LOOSE = -1  # node number of an end at which no node was marked
_SHORTEST_END = 0.02  # of a curve's length: what lies before its first mark may be no more than the pause there


@dataclass(frozen=True)
class PlacedCurve:
    """A curve from its first to its last node; arc length is 0 at the first.

    arc: (n,) m, increasing. quaternion: (n, 4), w first, signs aligned. tangent: (n, 3) as measured. marks: (m,) m,
    first 0 and last the curve's length; nodes: (m,) their numbers as scanned, -1 for an end that was not marked.
    index: place of the curve in the scan.
    """

    arc: Floats
    quaternion: Floats
    tangent: Floats
    marks: Floats
    nodes: Ints
    closed: bool
    boundary: bool
    timed: bool
    lengths: Floats
    index: int

    @property
    def length(self) -> float:
        """Length from the first to the last node, m."""
        return float(self.marks[-1])


def _with_ends(curve: CleanCurve) -> CleanCurve:
    """An open curve with its unmarked ends among its marks, where too few nodes were marked."""
    marks, nodes = curve.marks, curve.nodes
    if len(marks) >= 2:
        return curve
    low, high = curve.distance[0], curve.distance[-1]
    least = _SHORTEST_END * (high - low)
    before, after = not len(marks) or low + least < marks[0], not len(marks) or high - least > marks[-1]
    marks = np.concatenate([[low] * int(before), marks, [high] * int(after)])
    nodes = np.concatenate([[_LOOSE] * int(before), nodes, [_LOOSE] * int(after)]).astype(np.int64)
    lengths = _beside_only_node(curve, before, after) if len(curve.marks) else curve.lengths
    return replace(curve, marks=marks, nodes=nodes, lengths=lengths)


def _beside_only_node(curve: CleanCurve, before: bool, after: bool) -> Floats | None:
    """Lengths given for what lies before and after the only node of a curve, of those that there are."""
    if curve.lengths is None or len(curve.lengths) != 2:
        return curve.lengths
    for there, length, where in ((before, curve.lengths[0], "before"), (after, curve.lengths[1], "after")):
        if not there and not np.isnan(length):
            raise ScanError(
                f"a length of {length:g} m is given for what lies {where} the only node of {curve_name(curve.index)}, "
                f"but that is less than {100 * _SHORTEST_END:g} % of the curve: it has no segment there"
            )
    return curve.lengths[[before, after]]


def _place_open(curve: CleanCurve) -> PlacedCurve:
    curve = _with_ends(curve)
    return _cut(curve, curve.distance, curve.quaternion, curve.tangent, curve.marks, curve.nodes)


def _place_closed(curve: CleanCurve) -> PlacedCurve:
    """A closed curve starts at its first node, or where it was started if it has none."""
    if len(curve.marks) > 1:
        return _cut(curve, curve.distance, curve.quaternion, curve.tangent, curve.marks, curve.nodes)
    low, high = curve.distance[0], curve.distance[-1]
    start, node = (curve.marks[0], int(curve.nodes[0])) if len(curve.marks) else (low, _LOOSE)
    period = high - low
    tail = (curve.distance > low) & (curve.distance <= start)  # comes round again at the end
    rest = curve.distance >= start
    distance = np.concatenate([curve.distance[rest], curve.distance[tail] + period])
    quaternion = align_signs(np.concatenate([curve.quaternion[rest], curve.quaternion[tail]]))
    tangent = np.concatenate([curve.tangent[rest], curve.tangent[tail]])
    marks, nodes = np.array([start, start + period]), np.array([node, node], np.int64)
    return _cut(curve, distance, quaternion, tangent, marks, nodes)


def _cut(
    curve: CleanCurve, distance: Floats, quaternion: Floats, tangent: Floats, marks: Floats, nodes: Ints
) -> PlacedCurve:
    inside = (distance >= marks[0]) & (distance <= marks[-1])
    if np.count_nonzero(inside) < 2:
        raise ScanError(f"{curve_name(curve.index)} has fewer than two samples between its first and its last node")
    return PlacedCurve(
        distance[inside] - marks[0],
        quaternion[inside],
        tangent[inside],
        marks - marks[0],
        nodes,
        curve.closed,
        curve.boundary,
        curve.timed,
        _lengths(curve, len(marks) - 1),
        curve.index,
    )


def _lengths(curve: CleanCurve, segments: int) -> Floats:
    if curve.lengths is None:
        return np.full(segments, np.nan)
    if len(curve.lengths) != segments:
        raise ScanError(
            f"{curve_name(curve.index)} has {segments} segments, but lengths are given for {len(curve.lengths)}"
        )
    return curve.lengths


def place_curve(curve: CleanCurve) -> PlacedCurve:
    """The curve from its first to its last node; raises ScanError, naming it, if nothing is left.

    An open curve with fewer than two nodes, such as one that is still being scanned, keeps its loose ends.
    """
    return _place_closed(curve) if curve.closed else _place_open(curve)


def known_nodes(curves: Sequence[PlacedCurve]) -> Ints:
    """Numbers (k,) of the marked nodes, increasing, as the scan has them."""
    return np.unique(np.concatenate([c.nodes[c.nodes != _LOOSE] for c in curves]))


def number_nodes(curves: Sequence[PlacedCurve]) -> tuple[list[Ints], Bools]:
    """Dense node numbers per curve, in the order of the scanned ones; which (k,) of them are nodes of the network.

    Loose ends come after the marked nodes. Both ends of a closed curve without nodes are one number, but no node.
    """
    known = known_nodes(curves)
    numbers, is_node = [], [True] * len(known)
    for curve in curves:
        dense = np.searchsorted(known, curve.nodes)
        loose = np.flatnonzero(curve.nodes == _LOOSE)
        fresh = [not curve.closed] * (min(len(loose), 1) if curve.closed else len(loose))
        dense[loose] = len(is_node) + (0 if curve.closed else np.arange(len(loose)))
        is_node += fresh
        numbers.append(dense)
    return numbers, np.array(is_node)


def _layout(curves: Sequence[PlacedCurve], arcs: list[Floats], marks: list[Ints]) -> Layout:
    """Layout of rows at given arcs of each curve; marks: rows of each curve's nodes, counted from its own first row."""
    numbers, is_node = number_nodes(curves)
    first = np.concatenate([[0], np.cumsum([len(a) for a in arcs])])
    return Layout(
        arc=np.concatenate(arcs),
        first=first,
        closed=np.array([c.closed for c in curves]),
        boundary=np.array([c.boundary for c in curves]),
        marks=np.concatenate([m + f for m, f in zip(marks, first[:-1], strict=True)]),
        nodes=np.concatenate(numbers),
        is_node=is_node,
    )


def uniform_layout(curves: Sequence[PlacedCurve], step: float) -> Layout:
    """Rows at even distances of about `step` m along every segment: h = L / round(L / step), Eq. 3.22."""
    arcs, marks = [], []
    for curve in curves:
        lengths = np.diff(curve.marks)
        returns = (curve.nodes[1:] == curve.nodes[:-1]) & ((curve.nodes[1:] != _LOOSE) | curve.closed)
        counts = np.maximum(np.rint(lengths / step).astype(np.int64), np.where(returns, 3, 1))
        ends = np.concatenate([[0], np.cumsum(counts)])
        arcs.append(np.interp(np.arange(ends[-1] + 1), ends, curve.marks))
        marks.append(ends)
    return _layout(curves, arcs, marks)


def moved_layout(layout: Layout, curves: Sequence[PlacedCurve]) -> Layout:
    """The same rows on curves whose marks have moved: as evenly spread over every segment as before."""
    marks = np.concatenate([c.marks for c in curves])
    return replace(layout, arc=_spread(layout, marks))


def _spread(layout: Layout, marks: Floats) -> Floats:
    """Arc lengths (n,), m, of rows that share segments as in a layout, for other arcs of its marks (m,)."""
    start, end = layout.segment_rows[layout.row_segment].T
    share = (layout.arc - layout.arc[start]) / (layout.arc[end] - layout.arc[start])
    mark = layout.segments[layout.row_segment]
    result: Floats = (1 - share) * marks[mark] + share * marks[mark + 1]
    return result


def measured_layout(curves: Sequence[PlacedCurve]) -> Layout:
    """Rows at the measured samples and at the nodes of every curve."""
    arcs = [np.union1d(c.arc, c.marks) for c in curves]
    return _layout(curves, arcs, [np.searchsorted(a, c.marks) for a, c in zip(arcs, curves, strict=True)])
