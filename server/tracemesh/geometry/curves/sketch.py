"""Lengths of curves that were timed, not measured: those that make the network close (sketching, thesis chapter 5).

Between two nodes a hand moves at a fairly constant speed, but at another one on the next segment. The length of every
timed segment is its duration times an unknown factor; since a segment's vector is proportional to its length, node
positions and factors follow from one linear least-squares problem:

    sum |P_b - P_a - a V|^2 / (GAP |V|)^2  +  sum over timed segments (a - c)^2 / (SPEED c_0)^2

c is the speed that all timed segments share. Measured segments have a = 1 and give the scale; without any, c = 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, diags_array, vstack
from scipy.sparse.linalg import splu

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.placement import PlacedCurve, measured_layout
from tracemesh.geometry.curves.polyline import measured_edges
from tracemesh.geometry.curves.positions import segment_vectors
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.scan import CurveScan, Scan, curve_name

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_GAP = 0.02  # of a segment's length: errors of a phone's frames, and of the constant speed along it
_SPEED = 0.4  # relative deviation of the speed from segment to segment
_SLOWEST = 0.1  # of the shared speed: the least that a factor may be
_ROUNDS = 5  # of weights that follow the factors found


class _Problem:
    """Least squares in node positions (but the first), factors of timed segments, and their common factor."""

    def __init__(self, layout: Layout, vectors: Floats, timed: Bools) -> None:
        self._layout, self._vectors, self._timed = layout, vectors, np.flatnonzero(timed)
        self._free_speed = not timed.all()
        self._nodes, self._count = 3 * layout.node_count, len(self._timed)

    def _gap_rows(self) -> csc_array:
        """P_b - P_a - a V of every segment, three rows each; of measured ones, V belongs to the right-hand side."""
        a, b = self._layout.segment_nodes.T
        row = 3 * np.arange(len(a))[:, None] + np.arange(3)
        ones = np.ones(row.shape)
        places = [3 * a[:, None] + np.arange(3), 3 * b[:, None] + np.arange(3)]
        factor = np.broadcast_to(self._nodes + np.arange(self._count)[:, None], (self._count, 3))
        rows = np.concatenate([row.ravel(), row.ravel(), row[self._timed].ravel()])
        columns = np.concatenate([places[0].ravel(), places[1].ravel(), factor.ravel()])
        values = np.concatenate([-ones.ravel(), ones.ravel(), -self._vectors[self._timed].ravel()])
        shape = (row.size, self._nodes + self._count + 1)
        return coo_array((values, (rows, columns)), shape=shape).tocsc()

    def _speed_rows(self) -> csc_array:
        """a - c of every timed segment."""
        own = np.arange(self._count)
        shared = np.full(self._count, self._nodes + self._count)
        values = np.concatenate([np.ones(self._count), -np.ones(self._count)])
        places = (np.concatenate([own, own]), np.concatenate([self._nodes + own, shared]))
        return coo_array((values, places), shape=(self._count, self._nodes + self._count + 1)).tocsc()

    def solve(self) -> Floats:
        """Factor (s,) of every segment; 1 where it was measured."""
        matrix = vstack([self._gap_rows(), self._speed_rows()], format="csc")
        known = self._vectors.copy()
        known[self._timed] = 0.0
        speeds = np.zeros(self._count) if self._free_speed else np.ones(self._count)  # c, where it is not an unknown
        right = np.concatenate([known.ravel(), speeds])
        free = np.arange(3, matrix.shape[1] - (not self._free_speed))
        factors, speed = np.ones(len(self._vectors)), 1.0
        for _ in range(_ROUNDS):
            gap = np.repeat(1 / (_GAP * factors * self._layout.segment_lengths), 3)
            weight = np.concatenate([gap, np.full(self._count, 1 / (_SPEED * speed))])
            rows = (diags_array(weight) @ matrix[:, free]).tocsc()
            found = splu((rows.T @ rows).tocsc()).solve(rows.T @ (weight * right))
            speed = float(found[-1]) if self._free_speed else 1.0
            factors[self._timed] = np.maximum(found[self._nodes - 3 :][: self._count], _SLOWEST * speed)
        return factors


def _stretched(curve: PlacedCurve, factors: Floats) -> PlacedCurve:
    marks = np.concatenate([[0.0], np.cumsum(factors * np.diff(curve.marks))])
    return replace(curve, arc=np.interp(curve.arc, curve.marks, marks), marks=marks)


def with_lengths(curves: Sequence[PlacedCurve]) -> tuple[PlacedCurve, ...]:
    """The curves with the lengths that are given, and on timed segments those with which the network closes best; what
    a wheel measured is left alone.
    """
    curves = tuple(_with_given_lengths(curve) for curve in curves)
    timed = np.concatenate([np.isnan(curve.lengths) & curve.timed for curve in curves])
    if not timed.any():
        return curves
    layout = measured_layout(curves)
    factors = _Problem(layout, segment_vectors(layout, measured_edges(curves, layout)[1]), timed).solve()
    parts = np.split(factors, np.cumsum([len(c.marks) - 1 for c in curves])[:-1])
    return tuple(_stretched(c, f) if c.timed else c for c, f in zip(curves, parts, strict=True))


def _with_given_lengths(curve: PlacedCurve) -> PlacedCurve:
    given = ~np.isnan(curve.lengths)
    return _stretched(curve, np.where(given, curve.lengths / np.diff(curve.marks), 1.0)) if given.any() else curve


def give_lengths(scan: Scan, lengths: Mapping[tuple[int, int], float]) -> Scan:
    """The scan with measured lengths, m, of segments named by their curve and their place on it, both from 0.

    Raises ScanError where there is no such segment, or a length is not a positive number.
    """
    for (curve, segment), length in lengths.items():
        if curve >= len(scan.curves):
            raise ScanError(f"a length is given for {curve_name(curve)}, but there are {len(scan.curves)} curves")
        count = _segments(scan.curves[curve])
        if segment >= count:
            raise ScanError(
                f"a length is given for segment {segment + 1} of {curve_name(curve)}, which has {count} of them"
            )
        if not 0 < length < np.inf:
            raise ScanError(
                f"wanted a positive length for segment {segment + 1} of {curve_name(curve)}, got {length:g}"
            )
    return Scan(tuple(_given(i, curve, lengths) for i, curve in enumerate(scan.curves)))


def _given(index: int, curve: CurveScan, lengths: Mapping[tuple[int, int], float]) -> CurveScan:
    known = np.array([lengths.get((index, segment), np.nan) for segment in range(_segments(curve))])
    return curve if np.isnan(known).all() else replace(curve, lengths=known)


def _segments(curve: CurveScan) -> int:
    count = len(curve.node_ids)
    return 2 if count == 1 and not curve.closed else max(count - 1, 1)
