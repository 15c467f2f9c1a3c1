"""What a network must not depend on: the world's axes, the unit, and how its curves are told."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan

FIXED = NetworkParameters(step=0.012, stretch=0.0, bend=0.02, curve_bias="off")


def same(first: CurveNetwork, second: CurveNetwork) -> None:
    expected = first.points
    moved = second.points - second.points[: len(second.nodes)].mean(axis=0)
    np.testing.assert_allclose(
        moved, expected - expected[: len(first.nodes)].mean(axis=0), rtol=0, atol=1e-9 * first.diagonal
    )


def noisy(faulty_scan: Callable, name: str = "leaf") -> Scan:
    return faulty_scan(name, 0.003, seed=7, noise=0.02, heading=0.02, mark=0.001).scan


@pytest.mark.parametrize("parameters", [FIXED, NetworkParameters(step=0.012)], ids=["fixed", "automatic"])
def test_axes_of_the_world(faulty_scan: Callable, parameters: NetworkParameters) -> None:
    scan, turn = noisy(faulty_scan), exp(np.array([2.0, 1.0, -0.5]))
    turned = Scan(tuple(replace(c, tangent=c.tangent @ turn.T, normal=c.normal @ turn.T) for c in scan.curves))
    first, second = (reconstruct_network(s, parameters).network for s in (scan, turned))
    tolerance = 1e-9 if parameters is FIXED else 1e-7
    np.testing.assert_allclose(second.points, first.points @ turn.T, rtol=0, atol=tolerance * first.diagonal)


@pytest.mark.parametrize("unit", [1e-3, 1000.0])
@pytest.mark.parametrize("fixed", [True, False])
def test_unit_of_length(faulty_scan: Callable, unit: float, fixed: bool) -> None:
    scan = noisy(faulty_scan)
    scaled = Scan(tuple(replace(c, distance=unit * c.distance) for c in scan.curves))
    lengths = {"step": 0.012, "stretch": 0.0, "bend": 0.02} if fixed else {}
    parameters = [NetworkParameters(**{k: f * v for k, v in lengths.items()}) for f in (1.0, unit)]  # type: ignore[arg-type]
    first, second = (reconstruct_network(s, p) for s, p in zip((scan, scaled), parameters, strict=True))
    tolerance = 1e-9 * first.network.diagonal
    np.testing.assert_allclose(second.network.points / unit, first.network.points, rtol=0, atol=tolerance)
    np.testing.assert_allclose(second.uncertainty / unit, first.uncertainty, rtol=1e-6)


def test_numbers_of_nodes_and_where_distances_start(faulty_scan: Callable) -> None:
    scan = noisy(faulty_scan)
    others = Scan(tuple(replace(c, node_ids=3 * c.node_ids + 5, distance=c.distance + 2.5) for c in scan.curves))
    same(*(reconstruct_network(s, FIXED).network for s in (scan, others)))


def test_order_of_curves(faulty_scan: Callable) -> None:
    scan = noisy(faulty_scan)
    first = reconstruct_network(scan, FIXED).network
    second = reconstruct_network(Scan(scan.curves[::-1]), FIXED).network
    order = np.concatenate([s.points for s in first.segments])
    back = {c: [s for s in second.segments if s.curve == len(scan.curves) - 1 - c] for c in range(len(scan.curves))}
    found = np.concatenate([s.points for c in range(len(scan.curves)) for s in back[c]])
    np.testing.assert_allclose(second.points[found], first.points[order], rtol=0, atol=1e-9 * first.diagonal)


def backwards(curve: CurveScan) -> CurveScan:
    samples = len(curve.distance) - 1 - curve.node_samples[::-1]
    return replace(
        curve,
        distance=-curve.distance[::-1],
        tangent=-curve.tangent[::-1],
        normal=curve.normal[::-1],
        node_samples=samples,
        node_ids=curve.node_ids[::-1],
    )


@pytest.mark.parametrize("name", ["leaf", "egg"])
def test_direction_of_curves(faulty_scan: Callable, name: str) -> None:
    scan = noisy(faulty_scan, name)
    turned = Scan(tuple(backwards(c) if i % 2 else c for i, c in enumerate(scan.curves)))
    first, second = (reconstruct_network(s, FIXED).network for s in (scan, turned))
    for c in range(len(scan.curves)):
        a = np.concatenate([first.points[s.points] for s in first.segments if s.curve == c])
        b = [second.points[s.points] for s in second.segments if s.curve == c]
        b = [s[::-1] for s in b[::-1]] if c % 2 else b
        np.testing.assert_allclose(np.concatenate(b), a, rtol=0, atol=1e-9 * first.diagonal)


def started_at(curve: CurveScan, mark: int) -> CurveScan:
    """The same closed curve, scanned from another of its nodes on; its first and last sample are one."""
    cut, last = int(curve.node_samples[mark]), len(curve.distance) - 1
    order = np.r_[cut:last, 0 : cut + 1]
    distance = curve.distance[order] - curve.distance[cut]
    distance[last - cut :] += curve.distance[-1] - curve.distance[0]
    ids = np.r_[curve.node_ids[mark:-1], curve.node_ids[: mark + 1]]
    samples = np.r_[curve.node_samples[mark:-1] - cut, curve.node_samples[: mark + 1] + last - cut]
    return replace(
        curve,
        distance=distance,
        tangent=curve.tangent[order],
        normal=curve.normal[order],
        node_samples=samples,
        node_ids=ids,
    )


@pytest.mark.parametrize("mark", [1, 2])
def test_start_of_a_closed_curve(mark: int) -> None:
    scan = exact_scan(SHAPES["leaf"](), 0.004)
    moved = Scan((started_at(scan.curves[0], mark), *scan.curves[1:]))
    first, second = (reconstruct_network(s, FIXED).network for s in (scan, moved))
    tree = cKDTree(first.points)
    assert len(first.points) == len(second.points)
    assert tree.query(second.points)[0].max() < 1e-9 * first.diagonal
