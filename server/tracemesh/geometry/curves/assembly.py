"""The network that a layout's rows form: every point once, nodes shared."""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.network import CurveNetwork, Segment
from tracemesh.geometry.rotations import normalized

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def point_of_row(layout: Layout) -> Ints:
    """Network point (n,) of each row: nodes first in their order, then the rows between them."""
    point = np.empty(layout.size, np.int64)
    inner = np.ones(layout.size, bool)
    inner[layout.marks] = False
    point[inner] = layout.node_count + np.arange(np.count_nonzero(inner))
    point[layout.marks] = layout.nodes
    return point


def per_point(layout: Layout, values: Floats) -> Floats:
    """Values (n, ...) at rows as values (p, ...) at points; a node takes its first row's."""
    point = point_of_row(layout)
    _, first = np.unique(point, return_index=True)
    return values[first]


def _normals(layout: Layout, frames: Floats) -> Floats:
    """Unit normals (p, 3) at points; a node's is the mean of those of its curves."""
    total = np.zeros((layout.node_count, 3))
    np.add.at(total, layout.nodes, frames[layout.marks, :, 1])
    normals = per_point(layout, frames[:, :, 1])
    normals[: layout.node_count] = normalized(total)
    return normals


def assemble_network(
    layout: Layout, points: Floats, frames: Floats, uncertainty: Floats | None, curves: Ints
) -> CurveNetwork:
    """Network of points (n, 3), m, and frames (n, 3, 3) at a layout's rows.

    uncertainty: (p,) m, of the network's points, if known. curves: (c,) index of each in the scan. The place where a
    closed curve without nodes was started is no node of the network.
    """
    point = point_of_row(layout)
    segments = []
    for (start, end), curve in zip(layout.segment_rows, layout.segment_curve, strict=True):
        segments.append(Segment(point[start : end + 1], bool(layout.boundary[curve]), int(curves[curve])))
    nodes = np.flatnonzero(layout.is_node)
    normals = _normals(layout, frames)
    return CurveNetwork(per_point(layout, points), normals, nodes, tuple(segments), uncertainty)
