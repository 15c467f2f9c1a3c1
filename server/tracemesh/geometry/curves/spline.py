"""The regression's linear twin: a smoothing spline through frames developed into R^3.

Along a curve frames A_k are developed as u_k = sum log(A_{k+1} A_k^T), in the world's axes; a frame near A is
exp(d) A with d in R^3. In d the energy of Eq. 3.30 without nodes is, to second order, that of a smoothing spline, the
same for the three axes: one banded system, which makes cross-validation cheap. Closed curves are treated as open.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpbsv

from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.interpolation import interpolate
from tracemesh.geometry.curves.placement import PlacedCurve
from tracemesh.geometry.curves.samples import NetworkSamples
from tracemesh.geometry.rotations import darboux_frames, exp, log, matrix_to_quaternion, quaternion_difference

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bands = tuple[Floats, Floats]

_RIDGE = 1e-6  # of the data's weight: holds rows far from any sample to the resampled frames


@dataclass(frozen=True)
class Offsets:
    """Measured frames as rotation vectors from the resampled frames interpolated where they were measured.

    value: (m, 3) rad, world. row: (m,) layout row before each; fraction: (m,) of the way to the next row.
    weight: (m,) m, length of curve that the sample stands for.
    """

    value: Floats
    row: Ints
    fraction: Floats
    weight: Floats

    def part(self, chosen: Ints) -> "Offsets":
        """Only the chosen samples (k,)."""
        return Offsets(self.value[chosen], self.row[chosen], self.fraction[chosen], self.weight[chosen])

    def predicted(self, offset: Floats) -> Floats:
        """Offsets (n, 3) at rows, interpolated at the measured samples (m, 3)."""
        f = self.fraction[:, None]
        result: Floats = (1 - f) * offset.take(self.row, axis=0) + f * offset.take(self.row + 1, axis=0)
        return result


def measured_offsets(curves: Sequence[PlacedCurve], samples: NetworkSamples) -> Offsets:
    """Offsets of everything measured between the ends of a layout's curves."""
    layout, places, rows = samples.layout, [c.arc for c in curves], []
    for place, first, last in zip(places, layout.first[:-1], layout.first[1:] - 1, strict=True):
        inner = np.searchsorted(layout.arc[first + 1 : last], place, side="right")
        rows.append(first + inner)
    row, place = np.concatenate(rows), np.concatenate(places)
    edge = row - layout.curve[row]  # every curve before has one edge less than rows
    columns = interpolate(layout, samples.frames[:, :, :2].reshape(-1, 6), edge, place).reshape(-1, 3, 2)
    between = darboux_frames(columns[:, :, 0], columns[:, :, 1])
    value = quaternion_difference(np.concatenate([c.quaternion for c in curves]), matrix_to_quaternion(between))
    fraction = (place - layout.arc[row]) / layout.lengths[edge]
    weight = np.concatenate([np.gradient(p) for p in places])
    return Offsets(value, row, fraction, weight)


def _bands(count: int) -> Bands:
    """Zeros in the order in memory that the solver wants."""
    return np.zeros((3, count), order="F"), np.zeros((count, 3), order="F")


class DevelopedSpline:
    """Smoothing splines over the rows of resampled frames, for changing data and weights."""

    def __init__(self, samples: NetworkSamples) -> None:
        """Develop the frames and find the stencils."""
        layout = samples.layout
        self._n, self._edge, self._h = layout.size, layout.edges, layout.lengths
        self._samples = samples
        self._rate = log(samples.frames[self._edge + 1] @ np.swapaxes(samples.frames[self._edge], 1, 2))
        self._rate /= self._h[:, None]
        self._stretch, self._bend = self._stretching(), self._bending()

    def data_band(self, offsets: Offsets, weight: Floats) -> Bands:
        """Normal matrix (3, n), lower banded, and right-hand side (n, 3) of measured offsets with weights (m,)."""
        n, row, f = self._n, offsets.row, offsets.fraction
        band, right = _bands(n)
        band[0] = np.bincount(row, weight * (1 - f) ** 2, n) + np.bincount(row + 1, weight * f**2, n)
        band[0] += _RIDGE * (np.bincount(self._edge, self._h, n) + np.bincount(self._edge + 1, self._h, n))
        band[1] = np.bincount(row, weight * f * (1 - f), n)
        for axis in range(3):
            value = weight * offsets.value[:, axis]
            right[:, axis] = np.bincount(row, value * (1 - f), n) + np.bincount(row + 1, value * f, n)
        return band, right

    def _stretching(self) -> Bands:
        """Matrix (3, n), lower banded, and right-hand side (n, 3) of the stretching term of weight 1."""
        (band, right), edge, h = _bands(self._n), self._edge, self._h
        band[0] = np.bincount(edge, 1 / h, self._n) + np.bincount(edge + 1, 1 / h, self._n)
        band[1, edge] = -1 / h
        right[edge] += self._rate
        right[edge + 1] -= self._rate
        return band, right

    def _bending(self) -> Bands:
        """Matrix (3, n), lower banded, and right-hand side (n, 3) of the bending term of weight 1."""
        band, right = _bands(self._n)
        inner = np.flatnonzero(np.diff(self._edge) == 1)
        centre, before, after = self._edge[inner] + 1, self._h[inner], self._h[inner + 1]
        weight, (a, b, c) = 2 / (before + after), (1 / before, -1 / before - 1 / after, 1 / after)
        bend = weight[:, None] * (self._rate[inner + 1] - self._rate[inner])
        for at, coefficient in ((centre - 1, a), (centre, b), (centre + 1, c)):
            band[0, at] += weight * coefficient**2
            right[at] -= coefficient[:, None] * bend
        band[1, centre - 1] += weight * a * b
        band[1, centre] += weight * b * c
        band[2, centre - 1] += weight * a * c
        return band, right

    def penalty_band(self, weights: Weights) -> Bands:
        """Matrix (3, n), lower banded, and right-hand side (n, 3) of the stretching and bending terms."""
        stretch, bend = weights.stretch**2, weights.bend**4
        band, right = (stretch * s + bend * b for s, b in zip(self._stretch, self._bend, strict=True))
        return band, right

    def solve(self, data: Bands, penalty: Bands) -> Floats:
        """Offsets (n, 3), rad, of the smooth frames from the resampled ones."""
        matrix, right = data[0] + penalty[0], data[1] + penalty[1]
        _, result, failed = dpbsv(matrix, right, lower=1, overwrite_ab=1, overwrite_b=1)
        if failed:
            raise np.linalg.LinAlgError(f"row {failed} of the spline's system is not determined")
        return np.asarray(result)

    def frames(self, offset: Floats) -> Floats:
        """Frames (n, 3, 3) at offsets (n, 3), rad, from the resampled ones."""
        result: Floats = exp(offset) @ self._samples.frames
        return result
