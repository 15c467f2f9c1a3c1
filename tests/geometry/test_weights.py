"""Automatic smoothing lengths against the best possible ones, and the spline behind them against the regression."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tracemesh.geometry.curves.cleaning import clean_curves
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.placement import PlacedCurve, place_curve, uniform_layout
from tracemesh.geometry.curves.regression import RegressionSolver
from tracemesh.geometry.curves.resampling import resample
from tracemesh.geometry.curves.samples import NetworkSamples
from tracemesh.geometry.curves.weights import choose_weights, noise_level
from tracemesh.geometry.rotations import log

STEP = 0.015


def prepared(faulty: Any) -> tuple[list[PlacedCurve], NetworkSamples, np.ndarray]:
    """Placed curves, their samples, and the true frames at these."""
    curves = [place_curve(c) for c in clean_curves(faulty.scan.curves)]
    layout = uniform_layout(curves, STEP)
    parts = [c.at(layout.arc[layout.first[i] : layout.first[i + 1]])[1] for i, c in enumerate(faulty.curves)]
    return curves, resample(curves, layout, STEP), np.concatenate(parts)


def error(frames: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean(log(np.swapaxes(truth, 1, 2) @ frames) ** 2)))


@pytest.mark.parametrize("name", ["leaf", "cone", "torus"])
@pytest.mark.parametrize("noise", [0.005, 0.03])
def test_frames_are_nearly_as_good_as_with_the_best_weights(faulty_scan: Callable, name: str, noise: float) -> None:
    curves, samples, truth = prepared(faulty_scan(name, seed=1, noise=noise))
    choice = choose_weights(curves, samples, STEP)
    solver = RegressionSolver(samples.layout)
    found = error(solver.solve(samples.frames, choice.weights).frames, truth)
    bends = STEP * 2.0 ** np.arange(-2, 6, 0.5)
    best = min(error(solver.solve(samples.frames, Weights(0.0, bend)).frames, truth) for bend in bends)
    assert found < 1.15 * best
    assert best < error(samples.frames, truth)


@pytest.mark.parametrize("noise", [0.003, 0.01, 0.03])
def test_the_noise_of_the_frames_is_found(faulty_scan: Callable, noise: float) -> None:
    curves, samples, _ = prepared(faulty_scan("leaf", noise=noise))
    assert choose_weights(curves, samples, STEP).noise == pytest.approx(noise, rel=0.05)


def test_noise_levels_are_those_of_integrated_and_smoothed_noise(faulty_scan: Callable) -> None:
    """Predicted standard deviations of segment vectors and of smoothed normals, against twenty scans."""
    moved, turned, levels = [], [], []
    for seed in range(20):
        curves, samples, truth = prepared(faulty_scan("cone", seed=seed, noise=0.03))
        choice, layout = choose_weights(curves, samples, STEP), samples.layout
        level = noise_level(curves, choice, STEP)
        start, end = layout.segment_rows[0]
        wrong = (samples.frames - truth)[start:end, :, 0]
        moved.append(np.sum(wrong, axis=0) * layout.lengths[0])
        inner = (layout.arc > 0.2) & (layout.arc < layout.arc.max() - 0.2)
        turned.append(np.sum((choice.frames - truth)[inner, :, 1] ** 2, axis=1).mean() / 2)
        levels.append([level.walk[0] * layout.segment_lengths[0], level.normal[0] ** 2])
    expected = np.mean(levels, axis=0)
    assert np.mean(np.array(moved) ** 2) == pytest.approx(expected[0], rel=0.6)
    assert np.mean(turned) == pytest.approx(expected[1], rel=0.6)


def test_the_spline_is_the_regression_without_nodes(faulty_scan: Callable) -> None:
    curves, samples, _ = prepared(faulty_scan("leaf", noise=0.02))
    choice = choose_weights(curves, samples, STEP)
    apart = RegressionSolver(samples.layout)
    apart._stencil.stiffness = 0.0
    regressed = apart.solve(samples.frames, choice.weights).frames
    inner = np.setdiff1d(np.arange(samples.layout.size), samples.layout.first[:-1])
    difference = error(regressed[inner], choice.frames[inner])
    assert difference < 0.3 * error(samples.frames[inner], choice.frames[inner])


def test_exact_frames_are_hardly_smoothed(faulty_scan: Callable) -> None:
    curves, samples, truth = prepared(faulty_scan("leaf", 0.003))
    choice = choose_weights(curves, samples, STEP)
    found = RegressionSolver(samples.layout).solve(samples.frames, choice.weights)
    assert error(found.frames, truth) < 5e-4
