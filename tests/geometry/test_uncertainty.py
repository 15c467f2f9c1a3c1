"""Standard uncertainties are as large as the errors really are."""

from collections.abc import Callable

import numpy as np
import pytest

from tracemesh.geometry.curves.reconstruction import NetworkResult, reconstruct_network

FAULTS = (
    {"noise": 0.02},
    {"noise": 0.02, "heading": 0.026},
    {"noise": 0.02, "heading": 0.026, "scale": 0.003, "mark": 0.001},
)


def mean_square_ratio(result: NetworkResult, errors: np.ndarray) -> float:
    return float(np.mean((errors / result.uncertainty) ** 2))


def test_errors_over_uncertainties_are_about_one(
    faulty_scan: Callable, true_points: Callable, misfit: Callable
) -> None:
    """Root mean square over shapes and faults; a single network's errors hang together and scatter more."""
    ratios = []
    for name in ("leaf", "sphere", "torus", "cone", "egg"):
        for seed, faults in enumerate(FAULTS * 2):
            faulty = faulty_scan(name, seed=10 + seed, **faults)
            result = reconstruct_network(faulty.scan)
            errors = misfit(result.network.points, true_points(result.network, faulty.curves))
            ratios.append(mean_square_ratio(result, errors))
    assert 0.8 < np.sqrt(np.mean(ratios)) < 1.25
    assert np.sqrt(np.min(ratios)) > 0.3
    assert np.sqrt(np.max(ratios)) < 2.0


def test_twice_the_noise_is_twice_the_uncertainty(faulty_scan: Callable) -> None:
    means = [reconstruct_network(faulty_scan("cone", noise=n).scan).uncertainty.mean() for n in (0.01, 0.02)]
    assert means[1] / means[0] == pytest.approx(2, rel=0.35)


def test_the_same_scan_gives_the_same_uncertainty(faulty_scan: Callable) -> None:
    scan = faulty_scan("cone", noise=0.02).scan
    np.testing.assert_array_equal(reconstruct_network(scan).uncertainty, reconstruct_network(scan).uncertainty)
