"""Edge vectors between frames along smooth curves, to fourth order.

The integral of the tangent over an edge by Simpson's rule; the tangent at the edge's middle comes from the cubic
through the four nearest rows, made a unit vector again. The thesis takes the tangent at the start (first order); an
arc of constant rate (second order) errs eight times as much at a step of 1.6 % of the diagonal on a scan of lilium.
"""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.interpolation import interpolate
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.rotations import normalized

Floats = NDArray[np.float64]


def edge_vectors(layout: Layout, frames: Floats) -> Floats:
    """Edge vectors (e, 3), m, world, between frames [t N B] (n, 3, 3) at a layout's rows."""
    tangent, rows = frames[:, :, 0], layout.edges
    place = (layout.arc[rows] + layout.arc[rows + 1]) / 2
    middle = normalized(interpolate(layout, tangent, np.arange(len(rows)), place))
    result: Floats = layout.lengths[:, None] / 6 * (tangent[rows] + 4 * middle + tangent[rows + 1])
    return result
