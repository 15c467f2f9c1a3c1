"""Frames at chosen places along curves from unevenly measured ones (thesis 3.5.3).

The frame at a place is a local quadratic fit with Gaussian weights to the quaternions measured around it. The thesis's
plain weighted mean is biased at ends and wherever frames bend; the fit errs only in the fourth order of its width.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from tracemesh.geometry.curves.placement import PlacedCurve
from tracemesh.geometry.curves.samples import Layout, NetworkSamples
from tracemesh.geometry.rotations import normalized, quaternion_to_matrix

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PREFILTER = 0.5  # standard deviation of the Gaussian that is chosen automatically, in steps
_REACH = 3.0  # standard deviations after which it is cut
_NEAREST = 2  # measured samples on each side that a fit sees, however sparse they are
_RIDGE = 1e-9  # keeps a fit to few samples solvable; relative to the sum of weights


def _extended(curve: PlacedCurve, margin: float, used: Bools | None) -> tuple[Floats, Floats]:
    """Measured arcs and quaternions; those of a closed curve go round beyond both ends by `margin` m or two samples."""
    arc, quaternion = curve.arc, curve.quaternion
    if used is not None and np.count_nonzero(used) > 2 * _NEAREST:
        arc, quaternion = arc[used], quaternion[used]
    if not curve.closed:
        return arc, quaternion
    if arc[0] == 0 and arc[-1] == curve.length and len(arc) > 2:  # the same place, measured twice
        flip = -1.0 if quaternion[-1] @ quaternion[0] < 0 else 1.0
        middle = normalized(quaternion[:1] + flip * quaternion[-1:])
        arc, quaternion = arc[:-1], np.concatenate([middle, quaternion[1:-1]])
    n, length = len(arc), curve.length
    before = max(min(int(np.searchsorted(arc, length - margin)), n - _NEAREST - 1), 0)
    after = max(int(np.searchsorted(arc, margin, side="right")), _NEAREST + 1)
    flip = -1.0 if quaternion[-1] @ quaternion[0] < 0 else 1.0
    around = np.concatenate([arc[before:] - length, arc, arc[:after] + length])
    return around, np.concatenate([flip * quaternion[before:], quaternion, flip * quaternion[:after]])


def _windows(arc: Floats, places: Floats, prefilter: float) -> tuple[Ints, Ints, Floats]:
    """First and last + 1 measured sample that each place (k,) sees, and the width (k,) of its Gaussian, m.

    That is the pre-filter's, or as much as takes in the nearest samples.
    """
    after = np.searchsorted(arc, places)
    low = np.maximum(after - _NEAREST, 0)
    high = np.minimum(after + _NEAREST, len(arc))
    spread = np.maximum(places - arc[low], arc[high - 1] - places)
    width = np.maximum(prefilter, spread / 2)
    low = np.minimum(low, np.searchsorted(arc, places - _REACH * width))
    high = np.maximum(high, np.searchsorted(arc, places + _REACH * width, side="right"))
    return low, high, width


def _fit_weights(offset: Floats, row: Ints, rows: int) -> Floats:
    """Weight of each measured sample in the value at its place of the weighted quadratic fit around it.

    offset: (e,) distance from the place in widths; row: (e,) place, increasing.
    """
    gauss = np.exp(-0.5 * offset**2)
    moments, term = np.empty((rows, 5)), gauss
    for power in range(5):
        moments[:, power] = np.bincount(row, term, rows)
        term = term * offset
    matrix = moments[:, np.add.outer(np.arange(3), np.arange(3))]
    matrix += _RIDGE * moments[:, :1, None] * np.diag([0.0, 1.0, 1.0])
    right = np.zeros((rows, 3, 1))
    right[:, 0] = 1.0
    c = np.linalg.solve(matrix, right)[:, :, 0][row]
    result: Floats = gauss * (c[:, 0] + offset * (c[:, 1] + offset * c[:, 2]))
    return result


def fit_matrix(arc: Floats, places: Floats, prefilter: float) -> csr_array:
    """Linear map (k, n) from values measured at increasing arcs (n,) to fitted values at increasing places (k,), m.

    prefilter: standard deviation of the Gaussian, m.
    """
    low, high, width = _windows(arc, places, prefilter)
    counts = high - low
    indptr = np.concatenate([[0], np.cumsum(counts)])
    row = np.repeat(np.arange(len(places)), counts)
    column = np.arange(indptr[-1]) - np.repeat(indptr[:-1] - low, counts)
    weights = _fit_weights((arc[column] - places[row]) / width[row], row, len(places))
    return csr_array((weights, column, indptr), shape=(len(places), len(arc)))


def resample_curve(curve: PlacedCurve, places: Floats, prefilter: float, used: Bools | None = None) -> Floats:
    """Unit quaternions (k, 4) at increasing arcs (k,), m, on a curve; used: (n,) which measured samples to fit."""
    arc, quaternion = _extended(curve, _REACH * prefilter, used)
    fitted: Floats = normalized(fit_matrix(arc, places, prefilter) @ quaternion)
    if curve.closed and places[-1] == curve.length:
        fitted[-1] = fitted[0]
    return fitted


def resample(
    curves: Sequence[PlacedCurve], layout: Layout, step: float, prefilter: float | None = None
) -> NetworkSamples:
    """Frames of curves at the rows of a layout with the given step, m.

    prefilter: standard deviation of the Gaussian, m; None: PREFILTER steps.
    """
    width = PREFILTER * step if prefilter is None else prefilter
    rows = [slice(*layout.first[i : i + 2]) for i in range(len(curves))]
    fitted = [resample_curve(c, layout.arc[r], width) for c, r in zip(curves, rows, strict=True)]
    return NetworkSamples(layout, quaternion_to_matrix(np.concatenate(fitted)))
