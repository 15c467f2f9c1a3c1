"""Smoothing lengths by cross-validation on held-out measured samples.

A fifth of the samples, in short runs, is left out; a spline through the rest predicts them. Runs of a part of a step
keep the neighbours of a left-out sample, whose errors a sensor's filter may have made alike, out of its prediction.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.misclosure import NoiseLevel
from tracemesh.geometry.curves.placement import PlacedCurve
from tracemesh.geometry.curves.samples import Layout, NetworkSamples
from tracemesh.geometry.curves.spline import Bands, DevelopedSpline, Offsets, measured_offsets
from tracemesh.geometry.rotations import hat

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_FOLDS = 5
_ENOUGH_ROWS = 10_000
_RUNS_PER_STEP = 4
_BENDS = 2.0 ** np.arange(-2, 7)  # trials, in steps
_LEAST_TILT, _LEAST_DRIFT = 2e-4, 1e-4  # rad and relative: what no device does better, were its data free of noise
_SPLINE_GAIN = 0.265  # 3 sqrt(2) / 16: integral of the squared kernel of a smoothing spline of width 1
_STRETCHES = (0.25, 0.5, 1.0)


@dataclass(frozen=True)
class Choice:
    """weights: those that predict best. covariance: (3, 3) rad^2, of the rotation error of a measured frame, world.

    frames: (n, 3, 3), the spline's with these weights; curves do not know of each other in it.
    """

    weights: Weights
    covariance: Floats
    frames: Floats

    @property
    def noise(self) -> float:
        """Root mean square rotation error per axis of a measured frame, rad."""
        return float(np.sqrt(np.trace(self.covariance) / 3))


def _folds(curves: Sequence[PlacedCurve], step: float) -> Ints:
    """Fold (m,) in which each measured sample is left out; -1 for samples of curves too short to miss any."""
    folds = []
    for curve in curves:
        n = len(curve.arc)
        spacing = float(np.median(np.diff(curve.arc)))
        run = min(max(1, round(step / _RUNS_PER_STEP / spacing)), max(1, n // (2 * _FOLDS)))
        folds.append((np.arange(n) // run) % _FOLDS if n >= 2 * _FOLDS else np.full(n, -1))
    return np.concatenate(folds)


class _Trials:
    """Prediction error of weights, remembered."""

    def __init__(self, spline: DevelopedSpline, offsets: Offsets, fold: Ints) -> None:
        self._spline, self._count = spline, max(1, int(np.count_nonzero(fold >= 0)))
        more = _FOLDS / (_FOLDS - 1)
        self._data: list[Bands] = []
        self._left_out: list[Offsets] = []
        for left_out in range(_FOLDS):
            factor = np.where(fold < 0, 1.0, np.where(fold == left_out, 0.0, more))
            self._data.append(spline.data_band(offsets, offsets.weight * factor))
            self._left_out.append(offsets.part(np.flatnonzero(fold == left_out)))

    def covariance(self, weights: Weights) -> Floats:
        """Covariance (3, 3) rad^2, world, of the rotation errors of predicted left-out frames."""
        penalty = self._spline.penalty_band(weights)
        total = np.zeros((3, 3))
        for left_out, data in zip(self._left_out, self._data, strict=True):
            error = left_out.predicted(self._spline.solve(data, penalty)) - left_out.value
            total += error.T @ error
        return total / self._count

    def error(self, weights: Weights) -> float:
        """Root mean square rotation error per axis, rad, of predicted left-out frames."""
        return float(np.sqrt(np.trace(self.covariance(weights)) / 3))


def _vertex(logs: list[float], errors: list[float]) -> float:
    """Minimum of the parabola through three points around a lowest one."""
    a, b, c = logs
    x, y, z = errors
    curvature = (z - y) / (c - b) - (y - x) / (b - a)
    slope = (z - x) / (c - a)
    return float(np.clip(b - slope * (c - a) / 2 / curvature, a, c)) if curvature > 0 else float(b)


def choose_weights(curves: Sequence[PlacedCurve], samples: NetworkSamples, step: float) -> Choice:
    """Weights that predict left-out frames best, on as many of the curves as it takes to know them well."""
    few = curves[: max(1, int(np.searchsorted(samples.layout.first, _ENOUGH_ROWS)))]
    part = samples if len(few) == len(curves) else samples.first_curves(len(few))
    spline, offsets = DevelopedSpline(part), measured_offsets(few, part)
    weights, covariance = _search(_Trials(spline, offsets, _folds(few, step)), step)
    if part is not samples:
        spline, offsets = DevelopedSpline(samples), measured_offsets(curves, samples)
    return Choice(weights, covariance, _smooth(spline, offsets, weights))


def smooth_frames(curves: Sequence[PlacedCurve], samples: NetworkSamples, weights: Weights) -> Floats:
    """Frames (n, 3, 3) of splines through what was measured, at the rows of its samples."""
    return _smooth(DevelopedSpline(samples), measured_offsets(curves, samples), weights)


def _smooth(spline: DevelopedSpline, offsets: Offsets, weights: Weights) -> Floats:
    return spline.frames(spline.solve(spline.data_band(offsets, offsets.weight), spline.penalty_band(weights)))


def _search(trials: _Trials, step: float) -> tuple[Weights, Floats]:
    """Best weights and the covariance of their errors.

    Downhill over trial bends from one step on, a parabola through the lowest three, then up the stretches for as long
    as they help.
    """
    error = cache(lambda i: trials.error(Weights(0.0, float(_BENDS[i]) * step)))
    best, before = int(np.flatnonzero(_BENDS == 1.0)[0]), -1
    while best != before:
        before = best
        best = min((i for i in (best, best - 1, best + 1) if 0 <= i < len(_BENDS)), key=error)
    bend = float(_BENDS[best])
    if 0 < best < len(_BENDS) - 1:
        around = range(best - 1, best + 2)
        bend = float(np.exp(_vertex([float(np.log(_BENDS[i])) for i in around], [error(i) for i in around])))
    found = Weights(0.0, bend * step)
    least = trials.covariance(found)
    for stretch in _STRETCHES:
        trial = Weights(stretch * step, bend * step)
        there = trials.covariance(trial)
        if np.trace(there) >= np.trace(least):
            break
        found, least = trial, there
    return found, least


def noise_level(curves: Sequence[PlacedCurve], choice: Choice, step: float, layout: Layout) -> NoiseLevel:
    """Expected random errors of positions and smoothed frames along curves whose measured frames err independently.

    A rotation error w moves a tangent t by w x t.
    """
    spacing = np.array([c.length / (len(c.arc) - 1) for c in curves])
    width = max(choice.weights.bend, choice.weights.stretch, step)
    turned = hat(choice.frames[layout.edges, :, 0])
    moved = layout.lengths[:, None, None] * (turned @ choice.covariance @ np.swapaxes(turned, 1, 2))
    along = np.add.reduceat(moved, np.searchsorted(layout.edges, layout.segment_rows[:, 0]), axis=0)
    walk = (spacing[layout.segment_curve] / layout.segment_lengths)[:, None, None] * along
    smooth = (_SPLINE_GAIN / width * spacing)[layout.curve[layout.marks], None, None] * choice.covariance
    return NoiseLevel(walk, smooth + _LEAST_TILT**2 * np.eye(3), _LEAST_DRIFT)
