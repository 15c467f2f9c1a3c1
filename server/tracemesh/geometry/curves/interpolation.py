"""Cubic interpolation in arc length along the curves of a layout."""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.samples import Layout

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_STENCIL = 4


def _stencils(layout: Layout, edge: Ints) -> tuple[Ints, Floats]:
    """The four rows (k, 4) nearest to each edge and their arc lengths seen from it, m; a closed curve goes round."""
    curve = layout.curve[layout.edges[edge]]
    first, last = layout.first[:-1][curve, None], layout.first[1:][curve, None] - 1
    rows = layout.edges[edge, None] + np.arange(-1, _STENCIL - 1)
    shifted = rows + np.maximum(first - rows[:, :1], 0) - np.maximum(rows[:, -1:] - last, 0)
    turns = (rows > last).astype(np.int64) - (rows < first)
    around = rows - turns * (last - first)
    period = layout.arc[last] - layout.arc[first]
    closed = layout.closed[curve, None]
    chosen = np.where(closed, around, shifted)
    return chosen, layout.arc[chosen] + np.where(closed, turns * period, 0.0)


def interpolate(layout: Layout, values: Floats, edge: Ints, place: Floats) -> Floats:
    """Values (k, d) at arc lengths (k,), m, on the given edges (k,), from values (n, d) at rows.

    Of fourth order; linear on curves of fewer rows than a cubic needs.
    """
    start = layout.edges[edge]
    share = ((place - layout.arc[start]) / layout.lengths[edge])[:, None]
    result: Floats = (1 - share) * values[start] + share * values[start + 1]
    enough = np.flatnonzero(np.diff(layout.first)[layout.curve[start]] > _STENCIL)
    if not len(enough):
        return result
    rows, arcs = _stencils(layout, edge[enough])
    offset, cubic = place[enough, None] - arcs, np.zeros((len(enough), values.shape[1]))
    for i in range(_STENCIL):
        others = [j for j in range(_STENCIL) if j != i]
        weight = np.prod(offset[:, others] / (arcs[:, i : i + 1] - arcs[:, others]), axis=1)
        cubic += weight[:, None] * values[rows[:, i]]
    result[enough] = cubic
    return result
