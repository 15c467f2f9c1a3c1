"""Sketches: timed segments get the lengths that close the network; measured ones give the scale."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tracemesh.geometry.curves.reconstruction import reconstruct_network
from tracemesh.geometry.scan import CurveScan, Scan


def at_other_speeds(curve: CurveScan, random: np.random.Generator, spread: float) -> CurveScan:
    """The curve with distances proportional to durations, each segment at a speed of its own."""
    marks = curve.distance[curve.node_samples]
    factors = 1.7 * np.exp(spread * random.standard_normal(len(marks) - 1))
    timed = np.concatenate([[0.0], np.cumsum(factors * np.diff(marks))])
    return replace(curve, distance=np.interp(curve.distance, marks, timed), timed=True)


def sketch(scan: Scan, measured: int, spread: float = 0.25, seed: int = 0) -> Scan:
    random = np.random.default_rng(seed)
    curves = [c if i < measured else at_other_speeds(c, random, spread) for i, c in enumerate(scan.curves)]
    return Scan(tuple(curves))


def scaled_misfit(points: np.ndarray, truth: np.ndarray, misfit: Callable) -> float:
    """Mean distance in % of the true diagonal at the best scale."""
    x, y = points - points.mean(axis=0), truth - truth.mean(axis=0)
    scale = np.linalg.svd(x.T @ y, compute_uv=False).sum() / np.sum(x**2)
    return 100 * misfit(scale * points, truth).mean() / np.linalg.norm(np.ptp(truth, axis=0))


def errors_of(faulty: Any, scan: Scan, true_points: Callable, misfit: Callable, scaled: bool) -> float:
    network = reconstruct_network(scan).network
    truth = true_points(network, faulty.curves)
    if scaled:
        return scaled_misfit(network.points, truth, misfit)
    return float(100 * misfit(network.points, truth).mean() / np.linalg.norm(np.ptp(truth, axis=0)))


@pytest.mark.parametrize("name", ["leaf", "sphere", "torus", "cone", "egg"])
@pytest.mark.parametrize(("measured", "gain"), [(0, 0.9), (1, 0.4)])
def test_a_network_tells_lengths_better_than_a_constant_speed(
    faulty_scan: Callable, true_points: Callable, misfit: Callable, name: str, measured: int, gain: float
) -> None:
    """Root mean square over four scans: at the best scale, or at the scale of the first curve if that is measured."""
    sketched, constant = [], []
    for seed in range(4):
        faulty = faulty_scan(name, 0.004, seed, noise=0.02)
        scan = sketch(faulty.scan, measured, seed=seed + 10)
        plain = Scan(tuple(replace(c, timed=False) for c in scan.curves))
        sketched.append(errors_of(faulty, scan, true_points, misfit, not measured))
        constant.append(errors_of(faulty, plain, true_points, misfit, True))
    assert np.linalg.norm(sketched) < gain * np.linalg.norm(constant)


def test_a_constant_speed_stays_one(faulty_scan: Callable, true_points: Callable, misfit: Callable) -> None:
    faulty = faulty_scan("leaf", 0.002, seed=2, noise=0.02)
    network = reconstruct_network(sketch(faulty.scan, measured=0, spread=0.0)).network
    assert scaled_misfit(network.points, true_points(network, faulty.curves), misfit) < 0.15


def test_measured_lengths_are_left_alone(faulty_scan: Callable) -> None:
    faulty = faulty_scan("leaf", 0.002, noise=0.02)
    plain = reconstruct_network(faulty.scan).network
    curves = tuple(replace(c, timed=False) for c in faulty.scan.curves)
    np.testing.assert_array_equal(reconstruct_network(Scan(curves)).network.points, plain.points)
