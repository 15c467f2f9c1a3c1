"""How large the errors are that each curve has as a whole, and whether they are there at all.

In the equations of `misclosure` rotations b ~ N(0, S), scales s, marks' shifts u and the noise have unknown variances.
They are estimated by maximum likelihood with b, s, u integrated out (expectation-maximisation): what the data do not
show shrinks to nothing. Whether b, s, u are modelled is chosen by the likelihood with Schwarz's penalty for every
variance.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.misclosure import Misclosures, Summary

Floats = NDArray[np.float64]

_MOST_MARKS = 150  # that a few variances need to be well known
_ITERATIONS = 60
_NOISE_ITERATIONS = 5
_CHANGE = 0.01  # of every variance in an iteration, at which it ends
_LEAST = 1e-12  # square of a deviation, relative to where the iteration starts, that stands for none
_TRUST = 4.0  # equations' worth of trust in the expected noise
_GREATEST_ROTATION, _GREATEST_SCALE = 0.5, 0.1  # rad and relative: standard deviations
_FIRST_ROTATION, _FIRST_SCALE = 0.02, 0.005  # rad and relative: where the iteration starts


@dataclass(frozen=True)
class Variances:
    """rotation: (3, 3) rad^2, covariance of a curve's rotation, world. scale: of its relative scale. shift: m^2, of
    marks. All zero where such errors are not modelled. segments, normals: variance of the equations' noise over the
    expected.
    evidence: logarithm of the penalised likelihood.
    """

    rotation: Floats
    scale: float
    shift: float
    segments: float
    normals: float
    evidence: float

    @property
    def plausible(self) -> bool:
        """Whether the errors are such as devices have; greater ones speak for wrong node numbers instead."""
        turn = np.sqrt(np.linalg.eigvalsh(self.rotation)[-1])
        return bool(turn < _GREATEST_ROTATION and self.scale < _GREATEST_SCALE**2)

    @property
    def with_bias(self) -> bool:
        """Whether curves have errors as a whole."""
        return self.shift > 0


class _Estimation:
    """Expectation-maximisation over the equations of one network."""

    def __init__(self, parts: tuple[Summary, Summary], curves: int, marks: int, shift: float) -> None:
        self._parts, self._c, self._m = parts, curves, marks
        self._rotation = np.eye(3) * _FIRST_ROTATION**2
        self._scale, self._shift, self._unit = _FIRST_SCALE**2, shift**2, shift
        self._noise = [1.0, 1.0]
        self._own = 3 * np.arange(curves)[:, None] + np.arange(3)

    def _prior(self) -> Floats:
        c, size = self._c, 4 * self._c + self._m
        precision = np.zeros((size, size))
        diagonal = precision.reshape(-1)[:: size + 1]
        diagonal[3 * c : 4 * c], diagonal[4 * c :] = 1 / self._scale, 1 / self._shift
        precision[self._own[:, :, None], self._own[:, None, :]] = np.linalg.inv(self._rotation)
        return precision

    def _system(self) -> tuple[Floats, Floats]:
        first, second = (1 / f for f in self._noise)
        a, b = self._parts
        return self._prior() + first * a.square + second * b.square, first * a.linear + second * b.linear

    def run(self) -> Variances:
        """Iterate until the variances rest."""
        for _ in range(_ITERATIONS):
            before = self._values()
            matrix, right = self._system()
            inverse = np.linalg.inv(matrix)
            self._update(np.asarray(inverse @ right), np.asarray(inverse))
            if np.abs(np.log(self._values() / before)).max() < _CHANGE:
                break
        matrix, right = self._system()
        volume = np.linalg.slogdet(matrix)[1] - np.linalg.slogdet(self._prior())[1]
        explained = float(right @ np.linalg.solve(matrix, right))
        evidence = _evidence(self._parts, self._noise, volume - explained, 6 + 1 + 1)
        return Variances(self._rotation, self._scale, self._shift, self._noise[0], self._noise[1], evidence)

    def _values(self) -> Floats:
        return np.array([np.trace(self._rotation), self._scale, self._shift, *self._noise])

    def _update(self, mean: Floats, covariance: Floats) -> None:
        c = self._c
        second = covariance + np.outer(mean, mean)
        square = np.maximum(np.diag(second), 0.0)
        rotation = second[self._own[:, :, None], self._own[:, None, :]].sum(0) / c
        self._rotation = (rotation + rotation.T) / 2 + max(_LEAST, _LEAST * float(np.trace(rotation))) * np.eye(3)
        self._scale = float(square[3 * c : 4 * c].mean()) + _LEAST
        self._shift = float(square[4 * c :].mean()) + _LEAST * self._unit**2
        self._update_noise(mean, second)

    def _update_noise(self, mean: Floats, second: Floats) -> None:
        self._noise = [
            _noise(p, p.total - 2 * float(p.linear @ mean) + float(np.vdot(p.square, second))) for p in self._parts
        ]

    def noise_given(self, variances: Variances) -> Variances:
        """Other variances of the noise, as these equations show them, to given ones of the errors."""
        self._rotation, self._scale, self._shift = variances.rotation, variances.scale, variances.shift
        self._noise = [variances.segments, variances.normals]
        for _ in range(_NOISE_ITERATIONS):
            matrix, right = self._system()
            inverse = np.asarray(np.linalg.inv(matrix))
            mean = inverse @ right
            self._update_noise(mean, inverse + np.outer(mean, mean))
        return replace(variances, segments=self._noise[0], normals=self._noise[1])


def _noise(part: Summary, squares: float) -> float:
    """Variance factor from a sum of squares, held to 1 by some trust in what was expected."""
    return (_TRUST + max(squares, 0.0)) / (_TRUST + part.count)


def _evidence(parts: tuple[Summary, Summary], noise: list[float], rest: float, variances: int) -> float:
    """Logarithm of the likelihood of all equations, penalised for the number of variances estimated."""
    own = sum((p.count + _TRUST) * np.log(f) + (p.total + _TRUST) / f for p, f in zip(parts, noise, strict=True))
    penalty = variances * np.log(max(1, parts[0].count + parts[1].count))
    return float(-0.5 * (own + rest + penalty))


def _without_bias(parts: tuple[Summary, Summary]) -> Variances:
    noise = [_noise(p, p.total) for p in parts]
    return Variances(np.zeros((3, 3)), 0.0, 0.0, noise[0], noise[1], _evidence(parts, noise, 0.0, 0))


def with_noise_of(misclosures: Misclosures, variances: Variances) -> Variances:
    """Known variances of the errors of whole curves, with the noise that other equations of the same network show."""
    parts, curves, marks = misclosures.sample(_MOST_MARKS)
    return _Estimation(parts, len(curves), len(marks), 1.0).noise_given(variances)


def estimate_variances(misclosures: Misclosures, first_shift: float) -> tuple[Variances, Variances]:
    """Variances without and with errors of whole curves; first_shift: m, a first guess at the deviation of marks.

    A large network is judged by the part around its busiest node.
    """
    parts, curves, marks = misclosures.sample(_MOST_MARKS)
    return _without_bias(parts), _Estimation(parts, len(curves), len(marks), first_shift).run()
