"""From raw samples to one orientation per distance: validation, outliers, reversals, duplicates (thesis 3.5.3)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracemesh.errors import ScanError
from tracemesh.geometry.rotations import align_signs, darboux_frames, matrix_to_quaternion, normalized
from tracemesh.geometry.scan import CurveScan, curve_name
from tracemesh.geometry.sensing.orientation import angles_between
from tracemesh.geometry.vectors import lengths

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_WINDOW = 5  # samples of the running median
_PASSES = 3
_GATE = 4.0  # median absolute deviations (scaled to standard deviations) that a good sample may be away


@dataclass(frozen=True)
class CleanCurve:
    """One curve with strictly increasing distance.

    distance: (n,) m. quaternion: (n, 4), w first, signs aligned, of the frames [t N B]. tangent: (n, 3) as measured,
    not made orthogonal to the normal. marks: (m,) m, distances of marked nodes, increasing; nodes: (m,) their numbers.
    index: place of the curve in the scan. samples, dropped: how many were measured, and left
    out as outliers.
    """

    distance: Floats
    quaternion: Floats
    tangent: Floats
    marks: Floats
    nodes: Ints
    closed: bool
    boundary: bool
    timed: bool
    lengths: Floats | None
    index: int
    samples: int
    dropped: int


def _check(curve: CurveScan, name: str) -> None:
    n = len(curve.distance)
    if n < 2:
        raise ScanError(f"{name} has {n} sample{'s' * (n != 1)}: a curve needs at least two")
    for what, array in (("tangent", curve.tangent), ("normal", curve.normal)):
        if array.shape != (n, 3):
            raise ScanError(f"{name}: wanted {n} {what}s of three numbers, got an array of shape {array.shape}")
        finite = np.isfinite(array).all(axis=1)
        if not finite.all():
            raise ScanError(f"{name}: the {what} of sample {int((~finite).argmax()) + 1} is not finite")
        short = lengths(array) < 1e-9
        if short.any():
            raise ScanError(f"{name}: the {what} of sample {int(short.argmax()) + 1} is zero")
    if not np.isfinite(curve.distance).all():
        raise ScanError(
            f"{name}: the distance of sample {int((~np.isfinite(curve.distance)).argmax()) + 1} is not finite"
        )
    along = lengths(np.cross(normalized(curve.tangent), normalized(curve.normal))) < 1e-6
    if along.any():
        raise ScanError(f"{name}: tangent and normal of sample {int(along.argmax()) + 1} are parallel")
    _check_marks(curve, name)


def _check_marks(curve: CurveScan, name: str) -> None:
    samples, ids, n = curve.node_samples, curve.node_ids, len(curve.distance)
    if len(samples) != len(ids):
        raise ScanError(f"{name}: {len(samples)} samples are marked as nodes, but {len(ids)} node numbers are given")
    outside = (samples < 0) | (samples >= n)
    if outside.any():
        raise ScanError(f"{name}: node {ids[outside][0]} is marked at sample {samples[outside][0] + 1} of {n}")
    if (np.diff(samples) < 0).any():
        raise ScanError(f"{name}: the samples marked as nodes are not in increasing order")
    if curve.closed and len(ids) > 1 and ids[0] != ids[-1]:
        raise ScanError(f"{name} is closed, but begins at node {ids[0]} and ends at node {ids[-1]}", mend="open")
    span = float(np.ptp(curve.distance))
    if span <= 0:
        raise ScanError(f"{name} has no length: all its distances are {curve.distance[0]:g} m")
    steps = np.diff(curve.distance[samples])
    if (steps <= 0).any():
        i = int((steps <= 0).argmax())
        raise ScanError(f"{name}: no distance was travelled from node {ids[i]} to node {ids[i + 1]}")


def _robust_scale(values: Floats) -> float:
    """Standard deviation of the bulk of values (n,) around zero."""
    return 1.4826 * float(np.median(np.abs(values)))


def _vector_outliers(acceleration: Floats, magnetic: Floats) -> Bools:
    """Samples (n,) whose angle between the two measured vectors (n, 3) is not the one that the curve's others have.

    The dip angle is a constant of the place, so this sees a disturbed sample without looking at its neighbours.
    """
    angle = angles_between(acceleration, magnetic)
    error = angle - np.median(angle)
    result: Bools = np.abs(error) > _GATE * _robust_scale(error) + 1e-9
    return result


def _windowed_distances(frames: Floats) -> Floats:
    """Distances (5, 5, n) between the tangents and normals of each sample's window: itself and two on each side."""
    n, half = len(frames), _WINDOW // 2
    x = frames[:, :, :2].reshape(n, 6)
    x = np.concatenate([x[2 * half : half : -1], x, x[-half - 2 : -2 * half - 2 : -1]])  # one-sided at the ends
    distances = np.zeros((_WINDOW, _WINDOW, n))
    for lag in range(1, _WINDOW):
        apart = lengths(x[lag:] - x[:-lag])
        for a in range(_WINDOW - lag):
            distances[a, a + lag] = distances[a + lag, a] = apart[a : a + n]
    return distances


def _frame_outliers(frames: Floats) -> Bools:
    """Samples (n,) whose frame (n, 3, 3) stands out from the most central frame (medoid) of their window.

    Both the curve's own noise and the local change set the scale: a sharp bend is no outlier. Distances of matrices
    depend neither on the world's axes nor on the signs that quaternions would have to carry across an outlier.
    """
    n, middle = len(frames), _WINDOW // 2
    if n < _WINDOW:
        return np.zeros(n, bool)
    distances = _windowed_distances(frames)
    medoid = distances.sum(axis=1).argmin(axis=0)
    deviation = distances[medoid, middle, np.arange(n)]
    scale = _robust_scale(distances[middle, middle + 1])
    result: Bools = deviation > _GATE * scale + 1e-9
    far = np.flatnonzero(result)  # the local change is looked at where it matters only
    local = np.partition(distances[medoid[far], :, far], middle, axis=1)[:, middle]
    result[far] = deviation[far] > _GATE * local
    return result


def outliers(curve: CurveScan, frames: Floats) -> Bools:
    """Samples (n,) of a curve that no average should contain; frames: (n, 3, 3), the curve's own."""
    bad = np.zeros(len(frames), bool)
    if curve.acceleration is not None and curve.magnetic is not None:
        bad = _vector_outliers(curve.acceleration, curve.magnetic)
    for _ in range(_PASSES):  # outliers in a row hide each other from the median
        kept = np.flatnonzero(~bad)
        found = _frame_outliers(frames[kept])
        bad[kept[found]] = True
        if not found.any():
            break
    return bad if np.count_nonzero(~bad) >= 2 else np.zeros_like(bad)


def merge_duplicates(distance: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Distinct distances (k,), increasing, and the mean of the values (n, d) measured at each (k, d).

    For sign-aligned quaternions the normalised mean is within 0.002 degrees of Markley's (thesis 3.5.2).
    """
    order = np.argsort(distance, kind="stable")
    unique, start = np.unique(distance[order], return_index=True)
    count = np.diff(np.append(start, len(distance)))
    return unique, np.add.reduceat(values[order], start, axis=0) / count[:, None]


def clean_curve(curve: CurveScan, index: int) -> CleanCurve:
    """One orientation per distance along a curve; raises ScanError, naming the curve, where that cannot be."""
    name = curve_name(index)
    _check(curve, name)
    frames = darboux_frames(curve.tangent, curve.normal)
    bad = outliers(curve, frames)
    keep = ~bad
    distance = curve.distance[keep]
    kept = align_signs(matrix_to_quaternion(frames[keep]))
    unique, values = merge_duplicates(distance, np.hstack([kept, normalized(curve.tangent[keep])]))
    if len(unique) < 2:
        raise ScanError(f"{name} has no length once its outliers are left out")
    marks = curve.distance[curve.node_samples]
    return CleanCurve(
        unique,
        normalized(values[:, :4]),
        normalized(values[:, 4:]),
        marks,
        curve.node_ids,
        curve.closed,
        curve.boundary,
        curve.timed,
        curve.lengths,
        index,
        len(bad),
        int(bad.sum()),
    )


def clean_curves(curves: Sequence[CurveScan]) -> tuple[CleanCurve, ...]:
    """Every curve of a scan, cleaned; raises ScanError naming the first curve that cannot be used."""
    return tuple(_cleaned(curve, i) for i, curve in enumerate(curves))


def _cleaned(curve: CurveScan, index: int) -> CleanCurve:
    try:
        return clean_curve(curve, index)
    except ScanError as error:
        raise ScanError(str(error), (index,), error.mend or "remove") from None
