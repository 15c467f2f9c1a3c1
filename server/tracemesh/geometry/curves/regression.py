"""Smooth frames with common normals at nodes: Levenberg-Marquardt on SO(3)^n (thesis 3.5.4).

The sparsity pattern is found once, the factorisation's ordering too; a solver that is kept starts from where it ended,
which makes a change of weights cheap. Near the minimum the last factorisation is used again: its steps still shrink the
error a hundredfold, at a third of the price.
"""

from dataclasses import dataclass

import numpy as np
import qdldl
from numpy.typing import NDArray

from tracemesh.geometry.curves.energy import EnergyPoint, Weights, pattern_of
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.curves.stencil import Stencil

Floats = NDArray[np.float64]

_STEP = 1e-9  # rad; a smaller step ends the iteration
_NEAR = 1e-2  # rad; after a smaller step the nodes get their full stiffness
_NEARER = 3e-3  # rad; after a smaller step the factorisation is kept
_SLOW = 0.1  # a kept factorisation is renewed when steps shrink less than this
_SOFTENING = 0.01  # of the nodes' stiffness while far away: stiff ones let frames move along narrow valleys only
_TRIALS = 100
_DAMPING = 1e-3  # of the Hessian's diagonal, once a step failed
_ROUNDING = 1e-12  # relative; energies that differ less are the same
_FAR = 2.0  # deviations of the data frames from the smooth ones
_MEDIAN = 1.538  # median length of a vector of three independent normal deviates
_ROUNDS, _SETTLED = 20, 1e-3  # of reweighting: the most of them, and the change of trust that ends them


def _trust(data: Floats, frames: Floats) -> Floats:
    """Factors (u,) on the weights of data frames that make their squared distances Huber's loss."""
    distance = np.linalg.norm(data - frames, axis=(1, 2)) / np.sqrt(2)  # the angle, rad, while small
    far = _FAR * np.median(distance) / _MEDIAN
    return np.asarray(np.minimum(1.0, far / np.maximum(distance, np.finfo(float).tiny)))


@dataclass(frozen=True)
class Regression:
    """frames: (n, 3, 3) at a layout's rows. energy: at them, m. iterations: how many steps were tried."""

    frames: Floats
    energy: float
    iterations: int


class RegressionSolver:
    """Minimises the energy of one layout for changing data and weights."""

    def __init__(self, layout: Layout) -> None:
        """Find the pattern."""
        self._stencil = Stencil(layout)
        self._pattern = pattern_of(self._stencil)
        self._factors: qdldl.Solver | None = None
        self._last: Floats | None = None
        self._trust: Floats | float = 1.0

    def solve(self, frames: Floats, weights: Weights, start: Floats | None = None, robust: bool = False) -> Regression:
        """Minimiser for data frames (n, 3, 3) at the layout's rows.

        Started from the solution before, at first from `start` (n, 3, 3) or the data. robust: data frames far off count
        by their distance, not its square (Huber's loss); how far is far is estimated from all distances.
        """
        data, self._trust = frames[self._stencil.representative], 1.0
        if self._last is None:
            self._last = (frames if start is None else start)[self._stencil.representative]
        found, tried = self._minimise(data, weights)
        for _ in range(_ROUNDS if robust else 0):
            before, self._trust = self._trust, _trust(data, found.frames)
            if np.abs(self._trust - before).max() < _SETTLED:
                break
            found, more = self._minimise(data, weights)
            tried += more
        return Regression(found.frames[self._stencil.row], found.value, tried)

    def _minimise(self, data: Floats, weights: Weights) -> tuple[EnergyPoint, int]:
        """Minimum for the trust put in every data frame, and how many steps were tried."""
        assert self._last is not None
        soft = self._point(self._last, data, weights, _SOFTENING)
        near, first = self._descend(soft, data, weights, _SOFTENING, _NEAR)
        found, second = self._descend(self._point(near.frames, data, weights, 1.0), data, weights, 1.0, _STEP)
        self._last = found.frames
        return found, first + second

    def _point(self, frames: Floats, data: Floats, weights: Weights, softening: float) -> EnergyPoint:
        return EnergyPoint(self._stencil, frames, data, weights, softening, self._trust)

    def _descend(
        self, point: EnergyPoint, data: Floats, weights: Weights, softening: float, least: float
    ) -> tuple[EnergyPoint, int]:
        """Steps, and their number, until one is smaller than `least` rad."""
        damping, size, renew = 0.0, np.inf, True
        for trial in range(1, _TRIALS):
            if renew:
                self._factorise(point, damping)
            step = -self._solved(point.gradient().ravel()).reshape(-1, 3)
            moved = self._point(point.moved(step), data, weights, softening)
            before, size = size, float(np.abs(step).max())
            if moved.value <= point.value + _ROUNDING * abs(point.value):
                point, damping = moved, damping / 10 if damping > _DAMPING else 0.0
                renew = not (size < _NEARER and (renew or size < _SLOW * before))
            else:
                damping, renew = max(10 * damping, _DAMPING), True
            if size < least:
                return point, trial
        return point, _TRIALS

    def _factorise(self, point: EnergyPoint, damping: float) -> None:
        matrix = self._pattern.matrix
        matrix.data = self._pattern.entries(point.hessian_blocks())
        matrix.data[self._pattern.diagonal] *= 1 + damping
        if self._factors is None:
            self._factors = qdldl.Solver(matrix, upper=True)
        else:
            self._factors.update(matrix, upper=True)

    def _solved(self, right: Floats) -> Floats:
        assert self._factors is not None
        result: Floats = self._factors.solve(right)
        return result
