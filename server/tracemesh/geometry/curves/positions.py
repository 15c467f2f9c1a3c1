"""Positions of all curves at once from their edges (thesis 3.6, Eq. 3.31).

Least squares on the edges, not on their divergence as in the thesis's rows: its normal equations are the graph
Laplacian of the network. A segment's interior follows its nodes linearly in arc length, which leaves a small Laplacian
over the nodes and O(n) else. On frames without noise both are exact; from noisy ones the edges estimate better.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from tracemesh.errors import PiecesError
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.scan import curve_name

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Positions:
    """points: (n, 3) m, of a layout's rows, centred on the mean of the nodes; equal at rows of the same node.

    gaps: (s, 3) m, what each segment's edges lacked to lead from node to node.
    """

    points: Floats
    gaps: Floats


def segment_vectors(layout: Layout, edges: Floats) -> Floats:
    """Sum (s, 3) of the edge vectors (e, 3) of each segment, m."""
    result: Floats = np.add.reduceat(edges, np.searchsorted(layout.edges, layout.segment_rows[:, 0]), axis=0)
    return result


def check_connected(layout: Layout, curve_indices: Ints) -> None:
    """Raise PiecesError unless all curves hang together at nodes; curve_indices: (c,) by which it names them."""
    ends = layout.segment_nodes
    ones = np.ones(len(ends))
    graph = coo_array((ones, (ends[:, 0], ends[:, 1])), shape=(layout.node_count, layout.node_count))
    count, label = connected_components(graph, directed=False)
    if count == 1:
        return
    piece = label[layout.nodes[np.searchsorted(layout.marks, layout.first[:-1])]]
    names = [", ".join(curve_name(c) for c in curve_indices[piece == p]) for p in np.unique(piece)]
    pieces = "; ".join(f"({name})" for name in names)
    largest = np.bincount(piece).argmax()
    lone = tuple(int(c) for c in curve_indices[piece != largest])
    raise PiecesError(f"the network is in {count} pieces that share no node: {pieces}", lone, "nodes")


def node_positions(layout: Layout, vectors: Floats, weights: Floats) -> Floats:
    """Positions (k, 3), m, with mean zero, of nodes joined by segment vectors (s, 3) of weights (s, 3, 3)."""
    count = layout.node_count
    if count == 1:
        return np.zeros((1, 3))
    ends = 3 * layout.segment_nodes[:, :, None] + np.arange(3)
    a, b = ends[:, 0], ends[:, 1]
    rows, columns = np.stack([a, b, a, b], axis=1)[..., None], np.stack([a, b, b, a], axis=1)[:, :, None]
    values = np.stack([weights, weights, -weights, -weights], axis=1)
    row, column = (np.broadcast_to(i, values.shape).ravel() - 3 for i in (rows, columns))
    kept = (row >= 0) & (column >= 0)  # node 0 stays where it is
    entries = (values.ravel()[kept], (row[kept], column[kept]))
    laplacian = coo_array(entries, shape=(3 * count - 3, 3 * count - 3)).tocsc()
    pull = (weights @ vectors[:, :, None])[:, :, 0]
    right = np.bincount(b.ravel(), pull.ravel(), 3 * count) - np.bincount(a.ravel(), pull.ravel(), 3 * count)
    points = np.concatenate([np.zeros(3), splu(laplacian).solve(right[3:])]).reshape(-1, 3)
    return np.asarray(points - points.mean(axis=0))


def solve_positions(layout: Layout, edges: Floats, covariance: Floats | None = None) -> Positions:
    """Positions of a connected layout's rows from its edge vectors (e, 3), m.

    Minimises the sum over edges of |x_{k+1} - x_k - e_k|^2 / h_k: every metre travelled errs alike; or else what
    segments lack to close, by the covariance (s, 3, 3), m^2, of their errors.
    """
    vectors = segment_vectors(layout, edges)
    spread = layout.segment_lengths[:, None, None] * np.eye(3) if covariance is None else covariance
    nodes = node_positions(layout, vectors, np.asarray(np.linalg.inv(spread)))
    a, b = layout.segment_nodes.T
    gaps = nodes[b] - nodes[a] - vectors
    rates = gaps / layout.segment_lengths[:, None]
    edges = edges + rates[layout.edge_segment] * layout.lengths[:, None]
    points = np.zeros((layout.size, 3))
    points[layout.edges + 1] = edges
    points = np.cumsum(points, axis=0)
    first_mark = np.searchsorted(layout.marks, layout.first[:-1])
    shift = nodes[layout.nodes[first_mark]] - points[layout.first[:-1]]
    points += shift[layout.curve]
    points[layout.marks] = nodes[layout.nodes]
    return Positions(points, gaps)
