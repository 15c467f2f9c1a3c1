"""Errors of whole curves: planted ones are found, absent ones are not, and the world's axes do not matter."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tracemesh.geometry.curves.reconstruction import NetworkParameters, NetworkResult, reconstruct_network
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.scan import Scan

HEADING = np.radians(1.5)


def run(scan: Scan, mode: str) -> NetworkResult:
    return reconstruct_network(scan, NetworkParameters(curve_bias=mode))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["leaf", "cone", "egg"])
def test_planted_headings_are_found_and_taken_back(
    faulty_scan: Callable, true_points: Callable, misfit: Callable, name: str
) -> None:
    faulty = faulty_scan(name, seed=2, noise=0.02, heading=HEADING)
    result = run(faulty.scan, "auto")
    bias = result.report["curve_bias"]
    assert bias["on"]  # type: ignore[index]
    found = np.array([c["rotation_deg"] for c in bias["curves"]])  # type: ignore[index]
    taken_back = np.degrees(faulty.heading) + found[:, 2]
    assert np.ptp(taken_back) < 0.25 * np.ptp(np.degrees(faulty.heading))  # but for a turn of the whole network
    assert abs(found[:, :2]).max() < 0.4
    truth = true_points(result.network, faulty.curves)
    without = misfit(run(faulty.scan, "off").network.points, truth).mean()
    assert misfit(result.network.points, truth).mean() < 0.4 * without


@pytest.mark.parametrize("name", ["leaf", "torus", "egg"])
def test_headings_of_ten_degrees_are_taken_back_in_rounds(
    faulty_scan: Callable, true_points: Callable, misfit: Callable, name: str
) -> None:
    faulty = faulty_scan(name, seed=1, noise=0.02, heading=np.radians(10))
    result = run(faulty.scan, "auto")
    truth = true_points(result.network, faulty.curves)
    without = misfit(run(faulty.scan, "off").network.points, truth).mean()
    assert misfit(result.network.points, truth).mean() < 0.12 * without


def test_planted_scales_and_marks_are_taken_back(
    faulty_scan: Callable, true_points: Callable, misfit: Callable
) -> None:
    faulty = faulty_scan("torus", seed=1, noise=0.01, scale=0.01, mark=0.002)
    result = run(faulty.scan, "auto")
    truth = true_points(result.network, faulty.curves)
    without = misfit(run(faulty.scan, "off").network.points, truth).mean()
    assert result.report["curve_bias"]["on"]  # type: ignore[index]
    assert misfit(result.network.points, truth).mean() < 0.7 * without


@pytest.mark.parametrize("name", ["leaf", "sphere", "cone", "egg"])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_where_nothing_is_wrong_nothing_is_made_worse(
    faulty_scan: Callable, true_points: Callable, misfit: Callable, name: str, noise: float
) -> None:
    errors = []
    for mode in ("auto", "off"):
        worst = []
        for seed in range(3):
            faulty = faulty_scan(name, 0.0013 if noise else 0.003, seed, noise=noise)
            network = run(faulty.scan, mode).network
            worst.append(misfit(network.points, true_points(network, faulty.curves)).mean())
        errors.append(np.mean(worst))
    assert errors[0] < 1.1 * errors[1]


def test_vertical_is_no_special_direction(faulty_scan: Callable) -> None:
    faulty = faulty_scan("leaf", seed=3, noise=0.02, heading=HEADING)
    turn = exp(np.array([1.0, -0.7, 0.3]))
    turned = Scan(tuple(replace(c, tangent=c.tangent @ turn.T, normal=c.normal @ turn.T) for c in faulty.scan.curves))
    step = NetworkParameters(step=0.014)
    first, second = (reconstruct_network(scan, step).network for scan in (faulty.scan, turned))
    np.testing.assert_allclose(second.points, first.points @ turn.T, atol=1e-7 * first.diagonal)


def test_a_wrong_node_number_is_not_taken_for_a_bias(faulty_scan: Callable) -> None:
    faulty = faulty_scan("leaf", seed=4, noise=0.02)
    curves = list(faulty.scan.curves)
    ids = np.array(curves[2].node_ids)
    ids[0], ids[-1] = ids[-1], ids[0]
    curves[2] = replace(curves[2], node_ids=ids)
    report = run(Scan(tuple(curves)), "auto").report
    assert not report["curve_bias"]["on"]  # type: ignore[index]
    assert any("misses its node" in w for w in report["warnings"])  # type: ignore[attr-defined]
