"""Correction of a three-axis sensor: the ellipsoid that its vectors lie on is made a sphere again.

A sensor turned through all directions of a constant field measures, but for noise, m = S^-1 u + h with |u| constant: h
is its offset (hard iron), S^-1 its scales, skews and soft iron. Lengths tell nothing of a rotation of u, so the
symmetric S is taken; what is left of it is found by `calibration_alignment`.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.scan import Floats
from tracemesh.geometry.sensing.calibration_coverage import Coverage, coverage

LEAST_COVERAGE = 0.7
"""Of all directions; with less, what the unseen side is like is a guess."""
LEAST_READINGS = 50
LARGEST = 1e9
"""More than any sensor's unit makes of what it measures."""
MOST_SPREAD = 0.15
"""Of the lengths, corrected; a field that varies as much is not one field."""
MOST_UNCERTAIN = 20.0
"""Standard deviation of the parameter known worst over that of one reading, times the root of their number."""
GATE = 5.0
"""Robust standard deviations from the sphere beyond which a reading is left out."""
_ROUNDS = 3
_PAIRS = ((1, 2), (0, 2), (0, 1))


@dataclass(frozen=True)
class Correction:
    """What makes a sensor's vector right: matrix (3, 3) times the vector less the offset (3,), in the sensor's unit."""

    matrix: Floats
    offset: Floats

    def __call__(self, vectors: Floats) -> Floats:
        """Corrected vectors (n, 3)."""
        result: Floats = (vectors - self.offset) @ self.matrix.T
        return result


@dataclass(frozen=True)
class SensorFit:
    """A correction and how much it may be believed.

    coverage: of directions, after correction. spread_before, spread_after: standard deviation of the vectors' lengths
    over their mean. used: (n,) which readings were believed.
    """

    correction: Correction
    coverage: Coverage
    spread_before: float
    spread_after: float
    used: np.ndarray[tuple[int], np.dtype[np.bool_]]


def fit_sensor(vectors: Floats, name: str) -> SensorFit:
    """The correction of a sensor that measured vectors (n, 3) in poses all around; its matrix has determinant 1.

    name: of the sensor, for messages. Raises ScanError where a vector is not finite, or where they are too few or leave
    out too many directions, and says which.
    """
    _check(vectors, name)
    used = np.ones(len(vectors), bool)
    for _ in range(_ROUNDS):
        matrix, offset, uncertain = _sphere_of(vectors[used])
        residual = np.linalg.norm((vectors - offset) @ matrix, axis=1) - 1
        believed = np.abs(residual) <= max(GATE * 1.4826 * float(np.median(np.abs(residual))), 1e-9)
        if uncertain or (believed == used).all():
            break
        used = believed
    found = coverage(vectors if uncertain else (vectors - offset) @ matrix)
    if found.fraction < LEAST_COVERAGE or (uncertain and found.missing):
        raise ScanError(
            f"{name}: wanted readings with at least {LEAST_COVERAGE:.0%} of all directions of the device upwards or "
            f"along the field, got {found.fraction:.0%}; turn it so that these are measured, too: {found.in_words()}"
        )
    correction = Correction(matrix / np.cbrt(np.linalg.det(matrix)), offset)
    before, after = (_spread(v[used]) for v in (vectors, correction(vectors)))
    if uncertain or after > MOST_SPREAD:
        raise ScanError(
            f"{name}: wanted readings of one field, got vectors whose lengths vary however they are corrected"
        )
    return SensorFit(correction, found, before, after, used)


def _check(vectors: Floats, name: str) -> None:
    if vectors.ndim != 2 or vectors.shape[1] != 3 or len(vectors) < LEAST_READINGS:
        raise ScanError(
            f"{name}: wanted at least {LEAST_READINGS} vectors (n, 3), got an array of shape {vectors.shape}"
        )
    bad = ~(np.abs(vectors).max(axis=1) < LARGEST)
    if bad.any():
        raise ScanError(f"{name}: reading {int(bad.argmax()) + 1} is not finite, or larger than {LARGEST:g}")


def _sphere_of(vectors: Floats) -> tuple[Floats, Floats, bool]:
    """Symmetric S and offset h with |S (v - h)| = 1 by least squares, and whether the vectors leave them open."""
    from scipy.optimize import least_squares  # here: who only applies a calibration stays small without it

    middle, radius = _nearest_sphere(vectors)
    start = np.concatenate([np.ones(3), np.zeros(6)])
    unit = (vectors - middle) / radius
    try:
        with np.errstate(over="raise", invalid="raise"):
            found = least_squares(_residual, start, _jacobian, method="lm", xtol=1e-15, args=(unit,))
    except FloatingPointError:  # no sphere, however large, is the nearest
        return np.eye(3) / radius, middle, True
    matrix, offset = _symmetric(found.x), found.x[6:]
    if np.linalg.eigvalsh(matrix)[0] <= 0.05:
        return np.eye(3) / radius, middle, True
    smallest = np.linalg.svd(found.jac / np.sqrt(len(vectors)), compute_uv=False)[-1]
    return matrix / radius, middle + radius * offset, smallest < 1 / MOST_UNCERTAIN


def _nearest_sphere(vectors: Floats) -> tuple[Floats, float]:
    """Middle (3,) and radius of the sphere nearest in |v|^2; of several the one whose middle is nearest the mean."""
    mean = vectors.mean(axis=0)
    scale = float(np.sqrt(np.mean(np.sum((vectors - mean) ** 2, axis=1)))) or 1.0
    v = (vectors - mean) / scale
    columns = np.column_stack([2 * v, np.ones(len(v))])
    solution = np.linalg.lstsq(columns, np.sum(v * v, axis=1), rcond=1e-6)[0]
    radius = np.sqrt(max(float(solution[3] + solution[:3] @ solution[:3]), 1e-12))
    return mean + scale * solution[:3], scale * radius


def _symmetric(parameters: Floats) -> Floats:
    matrix = np.diag(parameters[:3])
    for value, (i, j) in zip(parameters[3:6], _PAIRS, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


def _residual(parameters: Floats, vectors: Floats) -> Floats:
    return cast(Floats, np.linalg.norm((vectors - parameters[6:]) @ _symmetric(parameters), axis=1) - 1)


def _jacobian(parameters: Floats, vectors: Floats) -> Floats:
    matrix, arm = _symmetric(parameters), vectors - parameters[6:]
    image = arm @ matrix
    outward = image / np.maximum(np.linalg.norm(image, axis=1, keepdims=True), 1e-12)
    mixed = [outward[:, i] * arm[:, j] + outward[:, j] * arm[:, i] for i, j in _PAIRS]
    return np.column_stack([outward * arm, *mixed, -outward @ matrix])


def _spread(vectors: Floats) -> float:
    norms = np.linalg.norm(vectors, axis=1)
    return float(np.std(norms) / np.mean(norms))
