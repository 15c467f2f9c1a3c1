"""What a network must not depend on: the world's axes, the unit, and how its curves are told.

Held to 1e-9 of the diagonal with given weights, and to 1e-4 where step, weights and errors of whole curves are chosen
from the data. A scan has no place in the world: what a translation does to a surface is in test_surface.py.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.network import CurveNetwork, extent_of
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan

FIXED = NetworkParameters(step=0.012, stretch=0.0, bend=0.02, curve_bias="off")
AUTOMATIC = NetworkParameters()
either_way = pytest.mark.parametrize("parameters", [FIXED, AUTOMATIC], ids=["fixed", "automatic"])


def assert_same(found: np.ndarray, expected: np.ndarray, network: CurveNetwork, parameters: NetworkParameters) -> None:
    """Points (n, 3) m of two networks that must be the same, one by one; network: the one expected."""
    tolerance = 1e-9 if parameters is FIXED else 1e-4
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * network.diagonal)


def noisy(faulty_scan: Callable, name: str = "leaf") -> Scan:
    return faulty_scan(name, 0.003, seed=7, noise=0.02, heading=0.02, mark=0.001).scan


@either_way
def test_axes_of_the_world(faulty_scan: Callable, parameters: NetworkParameters) -> None:
    scan, turn = noisy(faulty_scan), exp(np.array([2.0, 1.0, -0.5]))
    turned = Scan(tuple(replace(c, tangent=c.tangent @ turn.T, normal=c.normal @ turn.T) for c in scan.curves))
    first, second = (reconstruct_network(s, parameters).network for s in (scan, turned))
    assert_same(second.points, first.points @ turn.T, first, parameters)


@pytest.mark.parametrize("unit", [1e-3, 1000.0])
@either_way
def test_unit_of_length(faulty_scan: Callable, unit: float, parameters: NetworkParameters) -> None:
    scan = noisy(faulty_scan)
    scaled = Scan(tuple(replace(c, distance=unit * c.distance) for c in scan.curves))
    given = {k: unit * v for k in ("step", "stretch", "bend") if (v := getattr(parameters, k)) is not None}
    first, second = reconstruct_network(scan, parameters), reconstruct_network(scaled, replace(parameters, **given))
    assert_same(second.network.points / unit, first.network.points, first.network, parameters)
    np.testing.assert_allclose(second.uncertainty / unit, first.uncertainty, rtol=1e-6)


@either_way
def test_numbers_of_nodes_and_where_distances_start(faulty_scan: Callable, parameters: NetworkParameters) -> None:
    """Numbers that come in another order, too."""
    scan = noisy(faulty_scan)
    others = Scan(tuple(replace(c, node_ids=999 - 3 * c.node_ids, distance=c.distance + 2.5) for c in scan.curves))
    first, second = (reconstruct_network(s, parameters).network for s in (scan, others))
    one, other = (np.concatenate([n.points[s.points] for s in n.segments]) for n in (first, second))
    assert_same(other, one, first, parameters)


@either_way
def test_order_of_curves(faulty_scan: Callable, parameters: NetworkParameters) -> None:
    scan = noisy(faulty_scan)
    first = reconstruct_network(scan, parameters).network
    second = reconstruct_network(Scan(scan.curves[::-1]), parameters).network
    order = np.concatenate([s.points for s in first.segments])
    back = {c: [s for s in second.segments if s.curve == len(scan.curves) - 1 - c] for c in range(len(scan.curves))}
    found = np.concatenate([s.points for c in range(len(scan.curves)) for s in back[c]])
    assert_same(second.points[found], first.points[order], first, parameters)


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
@either_way
def test_direction_of_curves(faulty_scan: Callable, name: str, parameters: NetworkParameters) -> None:
    scan = noisy(faulty_scan, name)
    turned = Scan(tuple(backwards(c) if i % 2 else c for i, c in enumerate(scan.curves)))
    first, second = (reconstruct_network(s, parameters).network for s in (scan, turned))
    for c in range(len(scan.curves)):
        a = np.concatenate([first.points[s.points] for s in first.segments if s.curve == c])
        b = [second.points[s.points] for s in second.segments if s.curve == c]
        b = [s[::-1] for s in b[::-1]] if c % 2 else b
        assert_same(np.concatenate(b), a, first, parameters)


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
@either_way
def test_start_of_a_closed_curve(mark: int, parameters: NetworkParameters) -> None:
    scan = exact_scan(SHAPES["leaf"](), 0.004)
    moved = Scan((started_at(scan.curves[0], mark), *scan.curves[1:]))
    first, second = (reconstruct_network(s, parameters).network for s in (scan, moved))
    nearest = cKDTree(first.points).query(second.points)[1]
    assert len(first.points) == len(second.points) == len(np.unique(nearest))
    assert_same(second.points, first.points[nearest], first, parameters)


@pytest.mark.parametrize("way", ["leaf", "sphere", "torus", "cone", "egg"])
def test_extent_is_near_the_bounding_box_whatever_the_axes(way: str) -> None:
    network = SHAPES[way]().network(0.01)
    turned = replace(network, points=network.points @ exp(np.array([0.3, -1.2, 2.0])).T + 5.0)
    assert turned.extent == pytest.approx(network.extent, rel=1e-12)
    assert network.extent == pytest.approx(network.diagonal, rel=0.2)


def test_extent_of_a_straight_line_is_its_length_however_it_is_cut() -> None:
    direction = np.array([1.0, -2.0, 0.5])
    for cuts in ([0.0, 1.0], [0.0, 0.1, 0.35, 1.0]):
        at = np.array(cuts)[:, None] * direction
        assert extent_of(at[:-1], at[1:]) == pytest.approx(np.linalg.norm(direction))


def test_extent_of_a_point_is_nothing() -> None:
    assert extent_of(np.ones((3, 3)), np.ones((3, 3))) == 0.0


def test_extent_of_an_evenly_filled_box_is_its_diagonal() -> None:
    """Parallel lines through it, closer and closer: exact up to the square of their distance."""
    lines = (np.arange(50) + 0.5) / 50
    y, z = (grid.ravel() for grid in np.meshgrid(2 * lines, 3 * lines))
    starts = np.column_stack([0 * y, y, z])
    assert extent_of(starts, starts + np.array([4.0, 0.0, 0.0])) == pytest.approx(np.sqrt(4 + 9 + 16), rel=1e-3)
