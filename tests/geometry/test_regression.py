"""Regression on SO(3): derivatives, scipy's minimiser as oracle, nodes, warm starts, independence of the step."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from tracemesh.geometry.curves.cleaning import clean_curves
from tracemesh.geometry.curves.energy import EnergyPoint, Weights, pattern_of
from tracemesh.geometry.curves.placement import place_curve, uniform_layout
from tracemesh.geometry.curves.regression import RegressionSolver
from tracemesh.geometry.curves.resampling import resample
from tracemesh.geometry.curves.samples import NetworkSamples
from tracemesh.geometry.curves.stencil import Stencil
from tracemesh.geometry.rotations import exp, log
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan

WEIGHTS = Weights(stretch=0.05, bend=0.08)


def noisy_samples(name: str, step: float, noise: float = 0.1, seed: int = 0) -> NetworkSamples:
    curves = [place_curve(c) for c in clean_curves(exact_scan(SHAPES[name](), step / 4).curves)]
    samples = resample(curves, uniform_layout(curves, step), step)
    turns = exp(noise * np.random.default_rng(seed).standard_normal((samples.layout.size, 3)))
    return NetworkSamples(samples.layout, samples.frames @ turns)


def residuals(frames: np.ndarray, data: np.ndarray, stencil: Stencil, weights: Weights) -> np.ndarray:
    """The energy's terms one by one, as Eq. 3.27 states them, for an independent least-squares solver."""
    x = frames
    parts = [np.sqrt(stencil.data[k]) * (x[k] - data[k]) for k in range(stencil.size)]
    for left, right, h in zip(stencil.left, stencil.right, stencil.h, strict=True):
        parts.append(weights.stretch / np.sqrt(h) * (x[left] - x[right]))
    for k, (b, c, a) in enumerate(zip(stencil.before, stencil.centre, stencil.after, strict=True)):
        m = x[c].T @ (x[a] / stencil.h_out[k] + x[b] / stencil.h_in[k])
        parts.append(weights.bend**2 / np.sqrt((stencil.h_in[k] + stencil.h_out[k]) / 2) * (m - m.T) / 2)
    for p, q in stencil.pair:
        parts.append(np.sqrt(stencil.stiffness / 3) * np.tile(x[p][:, 1] - x[q][:, 1], (3, 1)))
    return np.concatenate([p.ravel() for p in parts])


@pytest.mark.parametrize("name", ["leaf", "egg"])
def test_value_is_the_sum_of_the_terms(name: str) -> None:
    samples = noisy_samples(name, 0.05)
    stencil = Stencil(samples.layout)
    x = samples.frames[stencil.representative]
    data = x @ exp(0.2 * np.random.default_rng(5).standard_normal((len(x), 3)))
    expected = np.sum(residuals(x, data, stencil, WEIGHTS) ** 2)
    assert EnergyPoint(stencil, x, data, WEIGHTS).value == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", ["leaf", "egg"])
def test_gradient_is_the_derivative_of_the_value(name: str) -> None:
    samples = noisy_samples(name, 0.08)
    stencil = Stencil(samples.layout)
    random = np.random.default_rng(1)
    data = samples.frames[stencil.representative]
    x = data @ exp(0.3 * random.standard_normal((len(data), 3)))
    gradient = EnergyPoint(stencil, x, data, WEIGHTS).gradient()
    for _ in range(5):
        w = random.standard_normal((len(x), 3))
        ahead, behind = (EnergyPoint(stencil, x @ exp(e * w), data, WEIGHTS).value for e in (1e-5, -1e-5))
        assert np.sum(gradient * w) == pytest.approx((ahead - behind) / 2e-5, rel=1e-6)


def test_hessian_is_the_second_derivative_where_residuals_of_bends_and_nodes_vanish() -> None:
    samples = noisy_samples("leaf", 0.08)
    stencil = Stencil(samples.layout)
    random = np.random.default_rng(2)
    data = samples.frames[stencil.representative]
    x = np.broadcast_to(exp(np.array([0.4, 1.0, 0.2])), data.shape).copy()
    pattern = pattern_of(stencil)
    pattern.matrix.data = pattern.entries(EnergyPoint(stencil, x, data, WEIGHTS).hessian_blocks())
    upper = pattern.matrix.toarray()
    full = upper + upper.T - np.diag(np.diag(upper))
    w = random.standard_normal(3 * len(x))
    turn = w.reshape(-1, 3)
    values = [EnergyPoint(stencil, x @ exp(e * turn), data, WEIGHTS).value for e in (1e-3, 0.0, -1e-3)]
    assert w @ full @ w == pytest.approx((values[0] - 2 * values[1] + values[2]) / 1e-6, rel=1e-5)


@pytest.mark.parametrize("name", ["leaf", "egg"])
def test_the_minimum_is_the_one_that_scipy_finds(name: str) -> None:
    samples = noisy_samples(name, 0.1)
    found = RegressionSolver(samples.layout).solve(samples.frames, WEIGHTS)
    stencil = Stencil(samples.layout)
    data = samples.frames[stencil.representative]

    def vector(w: np.ndarray) -> np.ndarray:
        return residuals(data @ exp(w.reshape(-1, 3)), data, stencil, WEIGHTS)

    oracle = least_squares(vector, np.zeros(3 * len(data)), xtol=1e-12, ftol=1e-14, gtol=1e-12)
    assert found.energy == pytest.approx(2 * oracle.cost, rel=1e-6)
    there = data @ exp(oracle.x.reshape(-1, 3))
    turned = np.linalg.norm(log(np.swapaxes(there[stencil.row], 1, 2) @ found.frames), axis=1)
    assert turned.max() < 1e-4


@pytest.mark.parametrize("weights", [WEIGHTS, Weights(0.0, 0.5), Weights(0.0, 0.02), Weights(1.0, 1.0)])
def test_normals_agree_at_nodes_and_frames_are_rotations(weights: Weights) -> None:
    samples = noisy_samples("leaf", 0.02, noise=0.05)
    layout = samples.layout
    frames = RegressionSolver(layout).solve(samples.frames, weights).frames
    np.testing.assert_allclose(np.swapaxes(frames, 1, 2) @ frames, np.broadcast_to(np.eye(3), frames.shape), atol=1e-12)
    normals = frames[layout.marks, :, 1]
    for node in range(layout.node_count):
        own = normals[layout.nodes == node]
        assert np.degrees(np.arcsin(np.linalg.norm(np.cross(own, own[:1]), axis=1))).max() < 0.002


def test_without_weights_and_conflict_the_data_are_returned() -> None:
    samples = noisy_samples("leaf", 0.05, noise=0.0)
    found = RegressionSolver(samples.layout).solve(samples.frames, Weights(0.0, 0.0))
    inner = np.setdiff1d(np.arange(samples.layout.size), samples.layout.marks)
    np.testing.assert_array_equal(found.frames[inner], samples.frames[inner])


def test_a_warm_start_ends_where_a_cold_one_does() -> None:
    samples = noisy_samples("leaf", 0.03)
    solver = RegressionSolver(samples.layout)
    solver.solve(samples.frames, Weights(0.0, 0.3))
    warm = solver.solve(samples.frames, WEIGHTS)
    cold = RegressionSolver(samples.layout).solve(samples.frames, WEIGHTS)
    np.testing.assert_allclose(warm.frames, cold.frames, atol=1e-9)


def test_a_bad_start_ends_where_a_good_one_does() -> None:
    samples = noisy_samples("leaf", 0.03, noise=0.05)
    good = RegressionSolver(samples.layout).solve(samples.frames, WEIGHTS)
    bad = samples.frames @ exp(0.25 * np.random.default_rng(4).standard_normal((samples.layout.size, 3)))
    again = RegressionSolver(samples.layout).solve(samples.frames, WEIGHTS, bad)
    assert again.energy == pytest.approx(good.energy, rel=1e-9)
    np.testing.assert_allclose(again.frames, good.frames, atol=1e-7)


def test_the_result_does_not_depend_on_the_step() -> None:
    """Smoothing lengths are metres: the same smoothing on rows half as far apart."""
    found = []
    for step in (0.02, 0.01):
        curves = [place_curve(c) for c in clean_curves(exact_scan(SHAPES["leaf"](), 0.0025).curves)]
        samples = resample(curves, uniform_layout(curves, step), step)
        frames = RegressionSolver(samples.layout).solve(samples.frames, Weights(0.1, 0.1)).frames
        found.append((samples, frames))
    coarse = found[0][0].layout
    first = slice(*coarse.first[:2])
    fine = found[1][0].layout.arc[: found[1][0].layout.first[1]]
    nearest = abs(fine[None] - coarse.arc[first, None]).argmin(axis=1)
    close = abs(fine[nearest] - coarse.arc[first]) < 1e-6
    turned = log(np.swapaxes(found[0][1][first][close], 1, 2) @ found[1][1][nearest][close])
    smoothed = log(np.swapaxes(found[0][0].frames[first][close], 1, 2) @ found[0][1][first][close])
    assert close.sum() >= 8
    assert np.linalg.norm(turned, axis=1).max() < 0.02 * np.linalg.norm(smoothed, axis=1).max()


@pytest.mark.parametrize("scale", [0.003, 0.03])
def test_robust_loss_bears_outliers_and_has_its_own_scale(scale: float) -> None:
    """5 % of the data frames turned at random; errors of tenths of a degree and of degrees are treated alike."""
    exact = noisy_samples("sphere", 0.01, noise=0.0)
    random = np.random.default_rng(4)
    noise, spoiled = random.standard_normal((exact.layout.size, 3)), random.random(exact.layout.size) < 0.05
    turned = exact.frames @ exp(np.where(spoiled[:, None], 1.0, scale) * noise)
    errors = []
    for robust in (False, True):
        found = RegressionSolver(exact.layout).solve(turned, Weights(0.0, 0.04), exact.frames, robust).frames
        errors.append(float(np.sqrt(np.mean((found - exact.frames) ** 2))))
    assert errors[1] < errors[0] / 3


def test_robust_solution_is_a_minimum_of_hubers_loss() -> None:
    samples = noisy_samples("leaf", 0.05)
    solver = RegressionSolver(samples.layout)
    found = solver.solve(samples.frames, WEIGHTS, robust=True).frames
    stencil = Stencil(samples.layout)
    x, data = found[stencil.representative], samples.frames[stencil.representative]
    distance = np.linalg.norm(x - data, axis=(1, 2))
    far = 2.0 * np.median(distance) / 1.538

    def loss(frames: np.ndarray) -> float:
        d = np.linalg.norm(frames - data, axis=(1, 2))
        huber = np.where(d < far, d**2, 2 * far * d - far**2)
        rest = EnergyPoint(stencil, frames, frames, WEIGHTS).value
        return float(np.sum(stencil.data * huber)) + rest

    random = np.random.default_rng(2)
    for size in (1e-2, 1e-3):
        for _ in range(10):
            assert loss(x @ exp(size * random.standard_normal((len(x), 3)))) > loss(x)


def great_circles(kink: float = 0.0, place: float = np.pi, parts: int = 24) -> tuple[Stencil, np.ndarray]:
    """Stencil and frames of three great circles, cut into `parts` edges between the nodes where they meet.

    kink: rad/m by which the first one turns faster for a quarter from `place` on, m, and slower for the next quarter.
    """
    scans, frames, marks = [], [], parts * np.arange(5)
    nodes = np.array([[0, 1, 3, 4, 0], [1, 2, 4, 5, 1], [2, 0, 5, 3, 2]])
    arc, axes = np.linspace(0, 2 * np.pi, 4 * parts + 1), np.eye(3)
    for k, ids in enumerate(nodes):
        u, v = axes[k], axes[(k + 1) % 3]
        normal = np.outer(np.cos(arc), u) + np.outer(np.sin(arc), v)
        tangent = np.outer(-np.sin(arc), u) + np.outer(np.cos(arc), v)
        scans.append(CurveScan(arc, tangent, normal, marks, ids, False, True))
        frames.append(np.stack([tangent, normal, np.cross(tangent, normal)], axis=2))
    curves = [place_curve(c) for c in clean_curves(scans)]
    layout = uniform_layout(curves, np.pi / 2 / parts)
    assert layout.size == 3 * len(arc)
    after = (arc - place) % (2 * np.pi)
    frames[0] = frames[0] @ exp(np.outer(kink * np.clip(np.minimum(after, np.pi - after), 0, None), axes[2]))
    stencil = Stencil(layout)
    return stencil, np.concatenate(frames)[stencil.representative]


def test_bends_go_through_every_node_that_a_curve_passes() -> None:
    """Also where a closed curve begins and ends; only the ends of open curves have none."""
    layout = noisy_samples("leaf", 0.05).layout
    stencil = Stencil(layout)
    is_open = np.flatnonzero(~layout.closed)
    ends = stencil.row[np.concatenate([layout.first[is_open], layout.first[is_open + 1] - 1])]
    passed = np.setdiff1d(stencil.row[layout.marks], ends)
    assert layout.closed.any()
    assert len(passed) > 10
    np.testing.assert_array_equal(stencil.centre, np.setdiff1d(np.arange(stencil.size), ends))
    at_node = np.isin(stencil.centre, passed)
    curve = layout.curve[stencil.representative]
    for side in (stencil.before, stencil.after):
        assert (side[at_node] != stencil.centre[at_node]).all()
        np.testing.assert_array_equal(curve[side[at_node]], curve[stencil.centre[at_node]])


def test_great_circles_through_nodes_have_no_energy() -> None:
    stencil, x = great_circles()
    assert len(stencil.pair) == 6
    assert EnergyPoint(stencil, x, x, Weights(0.0, 1.0)).value < 1e-12


@pytest.mark.parametrize("kink", [0.3, -0.05])
@pytest.mark.parametrize("shift", [0, 5])
def test_a_kink_at_a_node_costs_what_it_costs_elsewhere(kink: float, shift: int) -> None:
    """Two kinks and one of twice the size: at three nodes, or five edges behind them."""
    h = np.pi / 48
    stencil, x = great_circles(kink, np.pi + shift * h)
    stencil.stiffness = 0.0  # the kinks move the first circle's normals away from the others'
    rates = np.sin(np.array([1, 1 + kink, 1 - kink, 1]) * h) / h
    expected = 0.1**4 * 2 * np.sum(np.diff(rates) ** 2) / h
    assert EnergyPoint(stencil, x, x, Weights(0.0, 0.1)).value == pytest.approx(expected, rel=1e-9)


def test_normals_of_noisy_curves_bend_as_smoothly_at_nodes_as_between_them() -> None:
    """Half the step, half the jump of the normal's derivative at nodes: it is differentiable along curves there."""
    jumps = []
    curves = [place_curve(c) for c in clean_curves(shaken_leaf().curves)]
    for step in (0.01, 0.005):
        samples = resample(curves, uniform_layout(curves, step), step)
        found, s = RegressionSolver(samples.layout).solve(samples.frames, Weights(0.0, 0.1)), Stencil(samples.layout)
        n = found.frames[s.representative, :, 1]
        jump = (n[s.after] - n[s.centre]) / s.h_out[:, None] - (n[s.centre] - n[s.before]) / s.h_in[:, None]
        length = np.linalg.norm(jump, axis=1)
        at_node = np.isin(s.centre, s.row[samples.layout.marks])
        assert rms(length[at_node]) < 1.5 * rms(length[~at_node])
        jumps.append(rms(length[at_node]))
    assert jumps[0] / jumps[1] == pytest.approx(2, rel=0.1)


def shaken_leaf() -> Scan:
    """A scan of the leaf, its frames turned by 3 degrees rms about every axis."""
    random, curves = np.random.default_rng(3), []
    for curve in exact_scan(SHAPES["leaf"](), 0.0025).curves:
        turn = exp(0.05 * random.standard_normal((len(curve.distance), 3)))
        tangent, normal = ((turn @ v[:, :, None])[:, :, 0] for v in (curve.tangent, curve.normal))
        curves.append(replace(curve, tangent=tangent, normal=normal))
    return Scan(tuple(curves))


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
