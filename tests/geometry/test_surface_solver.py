"""A surface solved again where a curve changed equals one solved from scratch, and far patches do not move."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.geometry.network_fixtures import rings, sideways, window
from tracemesh.formats.networks import read_network
from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork, Floats
from tracemesh.geometry.surfaces.subdivision import thinned
from tracemesh.geometry.surfaces.surface import SurfaceParameters, span_surface
from tracemesh.geometry.surfaces.surface_solver import SurfaceSolver

DIAGONAL = np.sqrt(304)


@pytest.fixture(scope="module")
def fine_torus(shared_data: Path) -> CurveNetwork:
    return read_network((shared_data / "networks/torus-9.network.json").read_text())


@pytest.fixture(scope="module")
def torus(fine_torus: CurveNetwork) -> CurveNetwork:
    """Every second point: a quarter of the mesh."""
    return thinned(fine_torus, 2)


def torus_distance(points: Floats) -> Floats:
    return np.asarray(np.hypot(np.hypot(points[:, 0], points[:, 1]) - 4, points[:, 2]) - 2)


def assert_same_surface(one: Mesh, other: Mesh, chord: float = 2.5e-3) -> None:
    """Patches may be meshed differently: vertices of one lie on triangles of the other up to the height of a chord,
    told as a share of the diagonal.
    """
    distance = ClosestPoints(other.vertices, other.faces)(one.vertices)[1]
    assert distance.max() < chord * DIAGONAL
    assert distance.mean() < chord / 80 * DIAGONAL


def bent(network: CurveNetwork, segment: int = 5) -> CurveNetwork:
    """One segment pushed out of the surface in the middle."""
    inner = network.segments[segment].points[1:-1]
    points = network.points.copy()
    height = 0.02 * np.sin(np.linspace(0, np.pi, len(inner) + 2))[1:-1, None]
    points[inner] += height * network.normals[inner]
    return replace(network, points=points)


def without_segment(network: CurveNetwork, index: int) -> CurveNetwork:
    """One segment and its inner points left out."""
    gone = network.segments[index].points[1:-1]
    kept = np.setdiff1d(np.arange(len(network.points)), gone)
    number = np.full(len(network.points), -1)
    number[kept] = np.arange(len(kept))
    segments = tuple(replace(s, points=number[s.points]) for k, s in enumerate(network.segments) if k != index)
    return CurveNetwork(network.points[kept], network.normals[kept], number[network.nodes], segments)


@pytest.mark.parametrize("refinement", ["off", "on"])
@pytest.mark.parametrize("change", [bent, lambda n: without_segment(n, 5)], ids=["moved", "removed"])
def test_local_solution_equals_the_full_one(
    change: Callable[[CurveNetwork], CurveNetwork], refinement: str, torus: CurveNetwork
) -> None:
    parameters = SurfaceParameters(refinement=refinement)  # type: ignore[arg-type]
    solver = SurfaceSolver(parameters)
    first = solver.span(torus)
    assert first.report["resolved_patches"] == 48
    local, full = solver.span(change(torus)), span_surface(change(torus), parameters)
    assert 2 <= local.report["resolved_patches"] <= 16  # type: ignore[operator]
    assert local.report["euler_number"] == full.report["euler_number"] == 0
    assert_same_surface(local.mesh, full.mesh)


def test_added_curve_is_solved_like_the_full_network(fine_torus: CurveNetwork) -> None:
    solver = SurfaceSolver()
    solver.span(without_segment(fine_torus, 5))
    local, full = solver.span(fine_torus), span_surface(fine_torus)
    assert local.report["resolved_patches"] < 16  # type: ignore[operator]
    assert_same_surface(local.mesh, full.mesh, chord=8e-4)
    assert abs(torus_distance(local.mesh.vertices)).mean() < 1.1 * abs(torus_distance(full.mesh.vertices)).mean()


def test_unchanged_network_is_not_solved_again(torus: CurveNetwork) -> None:
    solver = SurfaceSolver(SurfaceParameters(refinement="off"))
    first, again = solver.span(torus), solver.span(torus)
    assert again.report["resolved_patches"] == 0
    np.testing.assert_array_equal(first.mesh.vertices, again.mesh.vertices)
    np.testing.assert_array_equal(first.mesh.faces[:, 0], again.mesh.faces[:, 0])


def test_order_of_segments_does_not_hide_that_patches_are_the_same(torus: CurveNetwork) -> None:
    solver = SurfaceSolver(SurfaceParameters(refinement="off"))
    solver.span(torus)
    turned = tuple(replace(s, points=s.points[::-1].copy()) for s in reversed(torus.segments))
    assert solver.span(replace(torus, segments=turned)).report["resolved_patches"] == 0


def test_another_network_is_solved_in_full() -> None:
    solver = SurfaceSolver(SurfaceParameters(refinement="off"))
    solver.span(window(5, lambda x, y: (0 * x, 0 * x, 0 * x)))
    network = rings([(1, 0, True), (1, 1.5, True)], sideways)
    for _ in range(2):
        result = solver.span(network)
        assert (result.report["resolved_patches"], result.report["euler_number"]) == (1, 0)
