"""Laws of the refinement of large meshes: the surface and the evidence of the small mesh, whatever the resolution."""

import numpy as np
import pytest

from tests.geometry.network_fixtures import octants, rings, upwards, window
from tests.geometry.test_surface import assert_oriented_manifold, wave
from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.surfaces.subdivision import thinned
from tracemesh.geometry.surfaces.surface import SurfaceParameters, SurfaceResult, span_surface
from tracemesh.geometry.surfaces.two_scales import LARGEST_REFINED


def large(network: CurveNetwork, size: float) -> SurfaceResult:
    result = span_surface(network, SurfaceParameters(mesh_size=size))
    assert len(result.mesh.vertices) > LARGEST_REFINED
    assert result.report["refinement"]["used"] is True  # type: ignore[index]
    return result


def test_large_sphere_is_found_exactly() -> None:
    mesh = large(octants(0.05), 0.04).mesh
    assert abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 3e-4
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)


def test_large_mesh_has_the_surface_and_the_evidence_of_a_small_one() -> None:
    network = window(8, wave)
    small, fine = span_surface(network), large(network, 0.025)
    assert_oriented_manifold(fine.mesh)
    np.testing.assert_array_equal(fine.mesh.vertices[: len(network.points)], network.points)
    truth = wave(*fine.mesh.vertices[:, :2].T)[0]
    linear = span_surface(network, SurfaceParameters(mesh_size=0.025, refinement="off")).mesh
    error, before = abs(fine.mesh.vertices[:, 2] - truth).mean(), abs(linear.vertices[:, 2] - truth).mean()
    assert error < before / 2
    distance = ClosestPoints(fine.mesh.vertices, fine.mesh.faces)(small.mesh.vertices)[1]
    assert distance.mean() < 1e-4 * network.diagonal
    evidence = [r.report["refinement"]["evidence"] for r in (small, fine)]  # type: ignore[index]
    assert 1 / 10 < evidence[1] / evidence[0] < 10


@pytest.mark.parametrize("every", [2, 3, 7, 100])
def test_thinned_networks_keep_the_ends_of_segments_and_points_between(every: int) -> None:
    network = window(12, wave)
    thin = thinned(network, every)
    np.testing.assert_array_equal(thin.points[thin.nodes], network.points[network.nodes])
    for segment, fewer in zip(network.segments, thin.segments, strict=True):
        assert len(fewer.points) == max(round(12 / every), 3) + 1
        line = [network.points[segment.points].tolist().index(p.tolist()) for p in thin.points[fewer.points]]
        assert line == sorted(line)
    assert set(np.unique(np.concatenate([s.points for s in thin.segments]))) == set(range(len(thin.points)))


def test_thinned_closed_curves_remain_polygons() -> None:
    thin = thinned(rings([(1, 0, True)], upwards), 1000)
    assert len(thin.segments[0].points) == 7
    assert thin.segments[0].points[0] == thin.segments[0].points[-1]
