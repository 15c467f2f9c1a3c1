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
    """Raise PiecesError, naming them, unless all curves hang together at nodes."""
    ends = layout.segment_nodes
    ones = np.ones(len(ends))
    graph = coo_array((ones, (ends[:, 0], ends[:, 1])), shape=(layout.node_count, layout.node_count))
    count, label = connected_components(graph, directed=False)
    if count == 1:
        return
    piece = label[layout.nodes[np.searchsorted(layout.marks, layout.first[:-1])]]
    names = [", ".join(curve_name(c) for c in curve_indices[piece == p]) for p in np.unique(piece)]
    pieces = "; ".join(f"({name})" for name in names)
    raise PiecesError(f"the network is in {count} pieces that share no node: {pieces}")


def node_positions(layout: Layout, vectors: Floats, weights: Floats) -> Floats:
    """Positions (k, 3), m, with mean zero, of nodes joined by weighted (s,) segment vectors (s, 3)."""
    a, b = layout.segment_nodes.T
    count = layout.node_count
    if count == 1:
        return np.zeros((1, 3))
    row, column = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    laplacian = coo_array((np.concatenate([weights, weights, -weights, -weights]), (row, column)), shape=(count, count))
    right = np.zeros((count, 3))
    np.add.at(right, b, weights[:, None] * vectors)
    np.add.at(right, a, -weights[:, None] * vectors)
    points = np.zeros((count, 3))
    points[1:] = splu(laplacian.tocsc()[1:, 1:]).solve(right[1:])
    points -= points.mean(axis=0)
    return points


def solve_positions(layout: Layout, edges: Floats) -> Positions:
    """Positions of a connected layout's rows from its edge vectors (e, 3), m.

    Minimises the sum over edges of |x_{k+1} - x_k - e_k|^2 / h_k: every metre travelled errs alike.
    """
    vectors = segment_vectors(layout, edges)
    nodes = node_positions(layout, vectors, 1 / layout.segment_lengths)
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
