"""Which way tangents are meant: along the curve at a sample, or along the chord to the next sample (a polyline).

Networks exported from meshes carry chords. Integrated as such they close to rounding; a smooth curve's tangents do not,
and close better in second order. The closure residual of the whole network tells which.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.placement import PlacedCurve
from tracemesh.geometry.curves.positions import Positions, solve_positions
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.network import extent_of
from tracemesh.geometry.rotations import normalized

Floats = NDArray[np.float64]

_FACTOR = 20.0  # how much better chords must close; noise closes alike either way
_SMALLEST = 1e-9  # of the length of the network: residuals below say nothing


@dataclass(frozen=True)
class MeasuredNetwork:
    """The network as measured, neither smoothed nor resampled: for its size, its convention and as exact polyline.

    chord_residual, smooth_residual: m, root mean square of what segments lack to close, for either convention.
    """

    layout: Layout
    positions: Positions
    is_polyline: bool
    chord_residual: float
    smooth_residual: float

    @property
    def extent(self) -> float:
        """Estimated diagonal, m, whatever the world's axes: see `extent_of`."""
        rows = self.layout.edges
        return extent_of(self.positions.points[rows], self.positions.points[rows + 1])

    def displacement(self, curve: int) -> float:
        """How far from its start a curve ends, m, before the network pulls it together."""
        own = self.layout.segment_curve == curve
        a, b = self.layout.segment_rows[own].T
        moved = self.positions.points[b] - self.positions.points[a] - self.positions.gaps[own]
        return float(np.linalg.norm(moved.sum(axis=0)))


def _tangents(curves: Sequence[PlacedCurve], layout: Layout) -> tuple[Floats, Floats]:
    """Measured tangent that holds after each row (n, 3), and the tangent interpolated at each row (n, 3)."""
    chord, smooth = [], []
    for i, curve in enumerate(curves):
        arc = layout.arc[layout.first[i] : layout.first[i + 1]]
        before = np.clip(np.searchsorted(curve.arc, arc, side="right") - 1, 0, len(curve.arc) - 1)
        chord.append(curve.tangent[before])
        columns = [np.interp(arc, curve.arc, component) for component in curve.tangent.T]
        smooth.append(normalized(np.stack(columns, axis=1)))
    return np.concatenate(chord), np.concatenate(smooth)


def measured_edges(curves: Sequence[PlacedCurve], layout: Layout) -> tuple[Floats, Floats]:
    """Edge vectors (e, 3), m, of a measured layout if tangents are chords to the next sample, and if they are not."""
    chord, smooth = _tangents(curves, layout)
    rows, h = layout.edges, layout.lengths[:, None]
    return h * chord[rows], h * (smooth[rows] + smooth[rows + 1]) / 2


def _residual(positions: Positions) -> float:
    return float(np.sqrt(np.mean(np.sum(positions.gaps**2, axis=1))))


def measure_network(curves: Sequence[PlacedCurve], layout: Layout) -> MeasuredNetwork:
    """Positions of connected curves at the rows of their measured layout, under the convention that closes better."""
    chords, curved = (solve_positions(layout, edges) for edges in measured_edges(curves, layout))
    residuals = _residual(chords), _residual(curved)
    floor = _SMALLEST * float(layout.lengths.sum())
    is_polyline = residuals[1] > floor and residuals[0] * _FACTOR < residuals[1]
    return MeasuredNetwork(layout, chords if is_polyline else curved, is_polyline, *residuals)


def points_on_polyline(measured: MeasuredNetwork, layout: Layout) -> Floats:
    """Points (n, 3), m, of the measured polyline at the rows of another layout of the same curves."""
    points = np.empty((layout.size, 3))
    for i in range(len(layout.closed)):
        to, source = slice(*layout.first[i : i + 2]), slice(*measured.layout.first[i : i + 2])
        for axis in range(3):
            points[to, axis] = np.interp(
                layout.arc[to], measured.layout.arc[source], measured.positions.points[source, axis]
            )
    return points
