"""Lengths of curves that were timed, not measured: those that make the network close (sketching, thesis chapter 5).

Between two nodes a hand moves at a fairly constant speed, but at another one on the next segment. The length of every
timed segment is its duration times an unknown factor; since a segment's vector is proportional to its length, node
positions and factors follow from one linear least-squares problem:

    sum |P_b - P_a - a V|^2 / (GAP |V|)^2  +  sum over timed segments (a - c)^2 / (SPEED c_0)^2

c is the speed that all timed segments share. Measured segments have a = 1 and give the scale; without any, c = 1.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, diags_array, vstack
from scipy.sparse.linalg import splu

from tracemesh.geometry.placement import PlacedCurve, measured_layout
from tracemesh.geometry.polyline import measured_edges
from tracemesh.geometry.positions import segment_vectors
from tracemesh.geometry.samples import Layout

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
    """The curves with lengths of timed segments such that the network closes best; measured ones are left alone."""
    if not any(curve.timed for curve in curves):
        return tuple(curves)
    layout = measured_layout(curves)
    timed = np.array([curve.timed for curve in curves])[layout.segment_curve]
    factors = _Problem(layout, segment_vectors(layout, measured_edges(curves, layout)[1]), timed).solve()
    parts = np.split(factors, np.cumsum([len(c.marks) - 1 for c in curves])[:-1])
    return tuple(_stretched(c, f) if c.timed else c for c, f in zip(curves, parts, strict=True))
