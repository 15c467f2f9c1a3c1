"""What keeps a network from closing, as linear equations in the errors that each curve has as a whole.

Per segment with vector V from mark i to mark j, and per mark with normal N, to first order:

    P_b - P_a - V     = b x V + s V + u_j t_j - u_i t_i + noise      (three equations)
    N_node - N        = b x N + u N'                    + noise      (two, in the tangent plane)

b: rotation of the curve's frames (a disturbed heading, a crooked mounting), rad; s: relative error of its lengths; u:
how far the node lies beyond the place where it was marked, m. Node positions P and normals N_node are free.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import breadth_first_order

from tracemesh.geometry.curves.positions import segment_vectors, solve_positions
from tracemesh.geometry.curves.quadrature import edge_vectors
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.rotations import hat, normalized

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


_END_DEVIATION = 2.0  # of a spline at its end, over that inside: its kernel is one-sided there


@dataclass(frozen=True)
class NoiseLevel:
    """Expected errors that no curve has as a whole.

    walk: (s, 3, 3) m, covariance per metre travelled of positions along each segment. turn: (m, 3, 3) rad^2, covariance
    of the rotation of a smoothed frame at each mark, if it is inside a curve; both in the world's axes. drift: relative
    to a segment's length, what no device does better.
    """

    walk: Floats
    turn: Floats
    drift: float

    def alike(self) -> "NoiseLevel":
        """As much noise in all directions."""
        walk, turn = (np.trace(c, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3) for c in (self.walk, self.turn))
        return NoiseLevel(walk, turn, self.drift)

    def of_segments(self, lengths: Floats) -> Floats:
        """Covariance (s, 3, 3), m^2, of segment vectors of lengths (s,), m."""
        length = lengths[:, None, None]
        return self.walk * length + (self.drift * length) ** 2 * np.eye(3)


@dataclass(frozen=True)
class Equations:
    """Equations y + A p = G theta + noise, each divided by the expected standard deviation of its noise.

    y: (r,). free: (r, f) sparse, for the free unknowns p. shared: (r, p) sparse, for theta: rotations (c, 3), scales
    (c,), shifts (m,), one after the other.
    """

    y: Floats
    free: csc_array
    shared: csc_array

    def summary(self, rows: Ints, columns: Ints) -> "Summary":
        """Sums over some equations, rows (k,), when their free unknowns are fitted; only some of theta, columns (l,).

        They are few: dense matrices are quicker.
        """
        y, a, g = self.y[rows], self.free.tocsr()[rows].toarray(), self.shared.tocsr()[rows].toarray()[:, columns]
        a = a[:, a.any(axis=0)]
        square, linear, total = g.T @ g, g.T @ y, float(y @ y)
        if a.shape[1]:
            right = a.T @ np.column_stack([g, y])
            fitted = np.linalg.solve(a.T @ a, right)
            square -= right[:, :-1].T @ fitted[:, :-1]
            linear -= right[:, :-1].T @ fitted[:, -1]
            total -= float(right[:, -1] @ fitted[:, -1])
        return Summary(square, linear, max(total, 0.0), len(y) - a.shape[1])


@dataclass(frozen=True)
class Summary:
    """Sum of squares as a function of theta: total - 2 linear . theta + theta^T square theta, over count equations."""

    square: Floats
    linear: Floats
    total: float
    count: int


def tangent_bases(normals: Floats) -> Floats:
    """Two unit vectors (k, 2, 3) orthogonal to each unit normal (k, 3) and to each other."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = normalized(np.cross(normals, least))
    return np.stack([first, np.cross(normals, first)], axis=1)


def _whitening(covariance: Floats) -> Floats:
    """Matrices W (k, d, d) such that W times errors of covariances (k, d, d) have covariance 1."""
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _sparse(rows: list[Ints], columns: list[Ints], values: list[Floats], shape: tuple[int, int]) -> csc_array:
    entries = np.concatenate([v.ravel() for v in values])
    index = tuple(
        np.concatenate([np.broadcast_to(i, v.shape).ravel() for i, v in zip(part, values, strict=True)])
        for part in (rows, columns)
    )
    return coo_array((entries, index), shape=shape).tocsc()


class Misclosures:
    """The equations of one network, from frames whose curves do not know of each other."""

    def __init__(self, layout: Layout, frames: Floats, noise: NoiseLevel) -> None:
        """frames: (n, 3, 3) at the layout's rows."""
        self.layout, self.noise, self._frames = layout, noise, frames
        self.curves, self.marks = len(layout.closed), len(layout.marks)
        self.size = 4 * self.curves + self.marks
        self.segments = self._segment_equations()
        self.normals = self._normal_equations()

    def _columns(self, curve: Ints) -> tuple[Ints, Ints]:
        """Columns (k, 3) of the rotations and (k,) of the scales of curves (k,)."""
        return 3 * curve[:, None] + np.arange(3), 3 * self.curves + curve

    def _segment_equations(self) -> Equations:
        layout = self.layout
        edges = edge_vectors(layout, self._frames)
        vectors, gaps = segment_vectors(layout, edges), solve_positions(layout, edges).gaps
        curve, start = layout.segment_curve, layout.segments
        weight = _whitening(self.noise.of_segments(layout.segment_lengths))
        tangent = self._frames[layout.marks, :, 0]
        row = 3 * np.arange(len(start))[:, None] + np.arange(3)
        rotation, scale = self._columns(curve)
        shift = 4 * self.curves + start
        columns = np.stack([vectors, -tangent[start], tangent[start + 1]], axis=2)
        scaled, before, after = np.moveaxis(weight @ columns, 2, 0)
        shared = _sparse(
            [row[:, :, None], row, row, row],
            [rotation[:, None, :], scale[:, None], shift[:, None], shift[:, None] + 1],
            [-weight @ hat(vectors), scaled, before, after],
            (row.size, self.size),
        )
        a, b = layout.segment_nodes.T
        free = _sparse(
            [row[:, :, None], row[:, :, None]],
            [(3 * a[:, None] + np.arange(3))[:, None], (3 * b[:, None] + np.arange(3))[:, None]],
            [-weight, weight],
            (row.size, 3 * layout.node_count),
        )
        return Equations((weight @ gaps[:, :, None]).ravel(), -free[:, 3:], shared)  # node 0 stays where it is

    def _normal_equations(self) -> Equations:
        layout, marks, node = self.layout, self.layout.marks, self.layout.nodes
        normal, curve = self._frames[marks, :, 1], layout.curve[marks]
        mean = np.zeros((layout.node_count, 3))
        np.add.at(mean, node, normal)
        mean = normalized(mean)
        at_end = np.isin(marks, layout.first[:-1]) | np.isin(marks, layout.first[1:] - 1)
        level = np.where(at_end, _END_DEVIATION, 1.0)[:, None, None]
        basis = tangent_bases(mean)[node]
        effect = level * (basis @ hat(normal))
        weight = _whitening(effect @ self.noise.turn @ np.swapaxes(effect, 1, 2))
        basis = weight @ basis
        row = 2 * np.arange(len(marks))[:, None] + np.arange(2)
        rotation, _ = self._columns(curve)
        shift = 4 * self.curves + np.arange(len(marks))
        bend = np.einsum("mij,mj->mi", basis, self._normal_rates()[marks])
        shared = _sparse(
            [row[:, :, None], row],
            [rotation[:, None, :], shift[:, None]],
            [-basis @ hat(normal), bend],
            (row.size, self.size),
        )
        free = _sparse(
            [row[:, :, None]], [(2 * node[:, None] + np.arange(2))[:, None]], [weight], (row.size, 2 * len(mean))
        )
        return Equations(np.einsum("mij,mj->mi", basis, mean[node] - normal).ravel(), -free, shared)

    def _normal_rates(self) -> Floats:
        """Change of the normal per metre (n, 3) at every row."""
        layout, normal = self.layout, self._frames[:, :, 1]
        rates = np.empty_like(normal)
        for first, last in zip(layout.first[:-1], layout.first[1:], strict=True):
            rates[first:last] = np.gradient(normal[first:last], layout.arc[first:last], axis=0)
        return rates

    def sample(self, most_marks: int) -> tuple[tuple[Summary, Summary], Ints, Ints]:
        """Sums over the equations between at most about `most_marks` marks that lie together; their curves (k,) and
        marks (l,).
        """
        layout = self.layout
        chosen = _neighbourhood(layout, most_marks)
        inside = chosen[layout.segment_nodes].all(axis=1)
        marks = np.flatnonzero(chosen[layout.nodes])
        curves = np.unique(layout.curve[layout.marks[marks]])
        columns = np.concatenate(
            [(3 * curves[:, None] + np.arange(3)).ravel(), 3 * self.curves + curves, 4 * self.curves + marks]
        )
        three, two = (np.flatnonzero(np.repeat(m, k)) for m, k in ((inside, 3), (chosen[layout.nodes], 2)))
        parts = self.segments.summary(three, columns), self.normals.summary(two, columns)
        return parts, curves, marks


def _neighbourhood(layout: Layout, most_marks: int) -> Bools:
    """Nodes (k,) nearest, in segments, to the node with most marks, until they have `most_marks` marks."""
    uses = np.bincount(layout.nodes, minlength=layout.node_count)
    a, b = layout.segment_nodes.T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(layout.node_count,) * 2).tocsr()
    order = breadth_first_order(graph, int(uses.argmax()), directed=False, return_predecessors=False)
    chosen = np.zeros(layout.node_count, bool)
    chosen[order[: max(2, int(np.searchsorted(np.cumsum(uses[order]), most_marks)) + 1)]] = True
    return chosen
