"""Cubic interpolation in arc length along the curves of a layout."""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.samples import Layout

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_STENCIL = 4


def _stencils(layout: Layout, edge: Ints) -> tuple[Ints, Floats]:
    """The four rows (4, k) nearest to each edge and their arc lengths seen from it, m; a closed curve goes round."""
    curve = layout.curve[layout.edges[edge]]
    first, last = layout.first[:-1][curve], layout.first[1:][curve] - 1
    rows = layout.edges[edge] + np.arange(-1, _STENCIL - 1)[:, None]
    shifted = rows + np.maximum(first - rows[0], 0) - np.maximum(rows[-1] - last, 0)
    turns = (rows > last).astype(np.int64) - (rows < first)
    around = rows - turns * (last - first)
    period = layout.arc[last] - layout.arc[first]
    closed = layout.closed[curve]
    chosen = np.where(closed, around, shifted)
    return chosen, layout.arc[chosen] + np.where(closed, turns * period, 0.0)


def interpolate(layout: Layout, values: Floats, edge: Ints, place: Floats) -> Floats:
    """Values (k, d) at arc lengths (k,), m, on the given edges (k,), from values (n, d) at rows.

    Of fourth order; linear on curves of fewer rows than a cubic needs.
    """
    enough = (np.diff(layout.first) > _STENCIL)[layout.curve[layout.edges[edge]]]
    if enough.all():
        return _cubic(layout, values, edge, place)
    result = np.empty((len(edge), values.shape[1]))
    result[enough] = _cubic(layout, values, edge[enough], place[enough])
    result[~enough] = _linear(layout, values, edge[~enough], place[~enough])
    return result


def _linear(layout: Layout, values: Floats, edge: Ints, place: Floats) -> Floats:
    start = layout.edges[edge]
    share = ((place - layout.arc[start]) / layout.lengths[edge])[:, None]
    result: Floats = (1 - share) * values[start] + share * values[start + 1]
    return result


def _cubic(layout: Layout, values: Floats, edge: Ints, place: Floats) -> Floats:
    rows, arcs = _stencils(layout, edge)
    offset, cubic = place - arcs, np.zeros((len(edge), values.shape[1]))
    for i in range(_STENCIL):
        weight = np.ones(len(edge))
        for j in range(_STENCIL):
            if j != i:
                weight *= offset[j] / (arcs[i] - arcs[j])
        cubic += weight[:, None] * values.take(rows[i], axis=0)
    return cubic
