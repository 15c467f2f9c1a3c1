"""Variances of errors of whole curves are the most probable ones, by the dense likelihood that nobody would compute."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import minimize

from tracemesh.geometry.curves.bias import Variances, estimate_variances
from tracemesh.geometry.curves.misclosure import Summary

CURVES, MARKS, TRUST = 6, 12, 4.0


@dataclass
class Model:
    """Two sets of equations y = G theta + noise; theta: rotations, scales and shifts of unknown variances."""

    y: list[np.ndarray]
    g: list[np.ndarray]

    def sample(self, most_marks: int) -> tuple[tuple[Summary, ...], range, range]:
        pairs = zip(self.y, self.g, strict=True)
        parts = tuple(Summary(g.T @ g, g.T @ y, float(y @ y), len(y)) for y, g in pairs)
        return parts, range(CURVES), range(MARKS)

    def evidence(self, rotation: np.ndarray, scale: float, shift: float, *noise: float) -> float:
        """As `Variances` has it, from the covariance of all equations."""
        of_theta = block_diag(*[rotation] * CURVES, scale * np.eye(CURVES), shift * np.eye(MARKS))
        y, g = np.concatenate(self.y), np.concatenate(self.g)
        factors = np.repeat(noise, [len(part) for part in self.y])
        covariance = g @ of_theta @ g.T + np.diag(factors)
        total = np.linalg.slogdet(covariance)[1] + y @ np.linalg.solve(covariance, y)
        held = TRUST * sum(np.log(f) + 1 / f for f in noise)
        return float(-0.5 * (total + held + 8 * np.log(len(y))))


def model(seed: int, rotation: float = 0.02, scale: float = 0.01, shift: float = 0.001) -> Model:
    random = np.random.default_rng(seed)
    deviations = np.concatenate([np.full(3 * CURVES, rotation), np.full(CURVES, scale), np.full(MARKS, shift)])
    theta = random.normal(size=len(deviations)) * deviations
    g = [random.normal(size=(rows, len(theta))) / 0.01 for rows in (60, 40)]
    return Model([part @ theta + random.normal(size=len(part)) for part in g], g)


def found_in(model: Model) -> Variances:
    return estimate_variances(model, 0.001)[1]  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(2))
def test_the_evidence_is_that_of_all_equations_together(seed: int) -> None:
    equations = model(seed)
    v = found_in(equations)
    dense = equations.evidence(v.rotation, v.scale, v.shift, v.segments, v.normals)
    assert v.evidence == pytest.approx(dense, abs=1e-6)


@pytest.mark.parametrize("planted", [{"rotation": 0.3}, {"shift": 0.0}])
def test_no_other_variances_are_clearly_likelier(planted: dict[str, float]) -> None:
    equations = model(5, **planted)
    v = found_in(equations)
    own = [v.scale, v.shift, v.segments, v.normals]
    root = np.linalg.cholesky(v.rotation)

    def cost(change: np.ndarray) -> float:
        turned = root @ (np.eye(3) + np.tril(change[:9].reshape(3, 3)))
        return -equations.evidence(turned @ turned.T, *(own * np.exp(change[9:])))

    best = minimize(cost, np.zeros(13), method="BFGS", options={"maxiter": 20}).fun
    assert -best - v.evidence < 0.1
