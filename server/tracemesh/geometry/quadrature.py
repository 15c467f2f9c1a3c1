"""Edge vectors between frames along smooth curves, to fourth order.

The integral of the tangent over an edge by Simpson's rule; the tangent at the edge's middle comes from the cubic
through the four nearest rows, made a unit vector again. The thesis takes the tangent at the start (first order); an
arc of constant rate (second order) errs eight times as much at a step of 1.6 % of the diagonal on a scan of lilium.
"""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.rotations import normalized
from tracemesh.geometry.samples import Layout

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_STENCIL = 4


def _stencils(layout: Layout) -> tuple[Ints, Floats]:
    """Rows (e, 4) around each edge and their arc lengths seen from it, m; a closed curve goes round."""
    curve = layout.curve[layout.edges]
    first, last = layout.first[:-1][curve, None], layout.first[1:][curve, None] - 1
    rows = layout.edges[:, None] + np.arange(-1, _STENCIL - 1)
    shifted = rows + np.maximum(first - rows[:, :1], 0) - np.maximum(rows[:, -1:] - last, 0)
    turns = (rows > last).astype(np.int64) - (rows < first)
    around = rows - turns * (last - first)
    period = layout.arc[last] - layout.arc[first]
    closed = layout.closed[curve, None]
    chosen = np.where(closed, around, shifted)
    return chosen, layout.arc[chosen] + np.where(closed, turns * period, 0.0)


def _middle(layout: Layout, tangent: Floats) -> Floats:
    """Unit tangents (e, 3) at the middle of edges from tangents (n, 3) at rows."""
    start = layout.edges
    middle = tangent[start] + tangent[start + 1]
    long_enough = np.flatnonzero(np.diff(layout.first)[layout.curve[start]] > _STENCIL)
    if not len(long_enough):
        return normalized(middle)
    rows, arcs = (part[long_enough] for part in _stencils(layout))
    place = (layout.arc[start[long_enough]] + layout.arc[start[long_enough] + 1])[:, None] / 2
    cubic = np.zeros((len(rows), 3))
    for i in range(_STENCIL):
        others = [j for j in range(_STENCIL) if j != i]
        weight = np.prod((place - arcs[:, others]) / (arcs[:, i : i + 1] - arcs[:, others]), axis=1)
        cubic += weight[:, None] * tangent[rows[:, i]]
    middle[long_enough] = cubic
    return normalized(middle)


def edge_vectors(layout: Layout, frames: Floats) -> Floats:
    """Edge vectors (e, 3), m, world, between frames [t N B] (n, 3, 3) at a layout's rows."""
    tangent = frames[:, :, 0]
    ends = tangent[layout.edges] + tangent[layout.edges + 1]
    result: Floats = layout.lengths[:, None] / 6 * (ends + 4 * _middle(layout, tangent))
    return result
