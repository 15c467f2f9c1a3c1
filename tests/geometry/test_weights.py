"""Automatic smoothing lengths against the best possible ones, and the spline behind them against the regression."""

from collections.abc import Callable
from dataclasses import replace
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
from tracemesh.geometry.rotations import exp, log
from tracemesh.geometry.scan import Scan

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


LOPSIDED = np.array([0.006, 0.012, 0.04])
"""rad about the world's axes: compass and gravity know the attitude about the vertical worst."""


def shaken(faulty: Any, seed: int) -> Any:
    """The scan with frames turned at random, mostly about the vertical."""
    random = np.random.default_rng(seed)
    curves = []
    for curve in faulty.scan.curves:
        turn = exp(LOPSIDED * random.standard_normal((len(curve.distance), 3)))
        tangent, normal = ((turn @ v[:, :, None])[:, :, 0] for v in (curve.tangent, curve.normal))
        curves.append(replace(curve, tangent=tangent, normal=normal))
    return replace(faulty, scan=Scan(tuple(curves)))


def test_the_directions_of_the_noise_are_found(faulty_scan: Callable) -> None:
    curves, samples, _ = prepared(shaken(faulty_scan("leaf"), 1))
    found = choose_weights(curves, samples, STEP).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(found)), LOPSIDED, rtol=0.1)
    assert abs(found - np.diag(np.diag(found))).max() < 0.1 * LOPSIDED[1] * LOPSIDED[2]


def test_noise_levels_are_those_of_integrated_and_smoothed_noise(faulty_scan: Callable) -> None:
    """Predicted covariances of segment vectors and of smoothed frames, against those of twenty scans."""
    faulty, moved, turned = faulty_scan("cone"), [], []
    for seed in range(20):
        curves, samples, truth = prepared(shaken(faulty, seed))
        choice, layout = choose_weights(curves, samples, STEP), samples.layout
        level = noise_level(curves, choice, STEP, layout)
        expected = level.of_segments(layout.segment_lengths)
        starts = np.searchsorted(layout.edges, layout.segment_rows[:, 0])
        wrong = layout.lengths[:, None] * (samples.frames - truth)[layout.edges, :, 0]
        error = np.add.reduceat(wrong, starts, axis=0)
        moved.append(np.einsum("si,si->s", error, np.linalg.solve(expected, error[:, :, None])[:, :, 0]))
        inner = (layout.arc > 0.2) & (layout.arc < layout.arc.max() - 0.2)
        about = log(choice.frames[inner] @ np.swapaxes(truth[inner], 1, 2))
        turned.append(np.mean(about**2, axis=0) / np.diagonal(level.turn, axis1=1, axis2=2).mean(axis=0))
    assert np.mean(moved) == pytest.approx(3, rel=0.3)
    np.testing.assert_allclose(np.mean(turned, axis=0), 1, rtol=0.5)


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
