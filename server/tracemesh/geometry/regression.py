"""Smooth frames with common normals at nodes: Levenberg-Marquardt on SO(3)^n (thesis 3.5.4).

The sparsity pattern is found once, the factorisation's ordering too; a solver that is kept starts from where it ended,
which makes a change of weights cheap.
"""

from dataclasses import dataclass

import numpy as np
import qdldl
from numpy.typing import NDArray

from tracemesh.geometry.energy import Energy, Stencil, Weights
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.samples import Layout

Floats = NDArray[np.float64]

_STEP = 1e-9  # rad; a smaller step ends the iteration
_ITERATIONS = 60
_DAMPING = 1e-3  # of the Hessian's diagonal, once a step failed


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
        self._energy = Energy(self._stencil)
        self._factors: qdldl.Solver | None = None
        self._last: Floats | None = None

    def solve(self, frames: Floats, weights: Weights) -> Regression:
        """Minimiser for data frames (n, 3, 3) at the layout's rows, started from the last solution or the data."""
        data = frames[self._stencil.representative]
        current = data if self._last is None else self._last
        value = self._energy.value(current, data, weights)
        damping, iteration = 0.0, 0
        while iteration < _ITERATIONS:
            gradient, entries = self._energy.model(current, data, weights)
            moved, lower, damping, tried = self._descend(current, data, weights, value, gradient, entries, damping)
            iteration += tried
            step = np.inf if moved is None else float(np.abs(moved - current).max())
            if moved is not None:
                current, value = moved, lower
            if moved is None or step < _STEP:
                break
        self._last = current
        return Regression(current[self._stencil.row], value, iteration)

    def _descend(
        self,
        current: Floats,
        data: Floats,
        weights: Weights,
        value: float,
        gradient: Floats,
        entries: Floats,
        damping: float,
    ) -> tuple[Floats | None, float, float, int]:
        """The first damped step that does not raise the energy, with energy, next damping and number of trials."""
        pattern = self._energy.pattern
        diagonal = entries[pattern.diagonal]
        for tried in range(1, 12):
            pattern.matrix.data = entries.copy()
            pattern.matrix.data[pattern.diagonal] = diagonal * (1 + damping)
            step = self._solve(-gradient.ravel()).reshape(-1, 3)
            moved = current @ exp(step)
            lower = self._energy.value(moved, data, weights)
            if lower <= value * (1 + 1e-13):
                return moved, lower, damping / 10 if damping > _DAMPING else 0.0, tried
            damping = max(10 * damping, _DAMPING)
        return None, value, damping, tried

    def _solve(self, right: Floats) -> Floats:
        if self._factors is None:
            self._factors = qdldl.Solver(self._energy.pattern.matrix, upper=True)
        else:
            self._factors.update(self._energy.pattern.matrix, upper=True)
        result: Floats = self._factors.solve(right)
        return result
