"""Laws of the refinement: exact on spheres, its derivative is the derivative of its energy, never worse than
what it was given.
"""

import numpy as np
import pytest

from tests.geometry.network_fixtures import octants, window
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import Floats
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.curvature_variation import Shape, variation_rows
from tracemesh.geometry.surfaces.edges import boundary_vertices, interior_edges
from tracemesh.geometry.surfaces.refinement import _system, refine
from tracemesh.geometry.surfaces.surface import SurfaceParameters, span_surface


def linear(parts: int = 8) -> tuple[Mesh, int]:
    network = window(parts, lambda x, y: (0.2 * x * y + 0.1 * x**2, 0.2 * y + 0.2 * x, 0.2 * x))
    return span_surface(network, SurfaceParameters(refinement="off")).mesh, len(network.points)


def shape_of(mesh: Mesh, vertices: Floats | None = None, normals: Floats | None = None) -> Shape:
    return Shape(
        mesh.vertices if vertices is None else vertices,
        mesh.normals if normals is None else normals,
        mesh.faces,
        interior_edges(mesh.faces),
        boundary_vertices(mesh.faces, len(mesh.vertices)),
    )


def slow_jump_energy(mesh: Mesh) -> float:
    """Sum over edges of 3 |e|^2 / (A1 + A2) |jump of the conormal derivative of N|^2, edge by edge."""
    total, edges = 0.0, interior_edges(mesh.faces)
    for i, j, left, right in zip(edges.start, edges.end, edges.left_tip, edges.right_tip, strict=True):
        e = mesh.vertices[j] - mesh.vertices[i]
        jump, area = np.zeros(3), 0.0
        for tip in (left, right):
            out = mesh.vertices[i] - mesh.vertices[tip]
            along = (mesh.vertices[tip] - mesh.vertices[i]) @ e / (e @ e)
            foot = out + along * e
            on_edge = (1 - along) * mesh.normals[i] + along * mesh.normals[j]
            jump += (on_edge - mesh.normals[tip]) / np.linalg.norm(foot)
            area += np.linalg.norm(np.cross(out, e)) / 2
        middle = normalised(mesh.normals[i] + mesh.normals[j])
        total += 3 * (e @ e) / area * (jump @ jump - (jump @ middle) ** 2)
    return total


def test_jump_energy_equals_the_slow_one() -> None:
    mesh, _ = linear()
    rows = variation_rows(shape_of(mesh), 0.0)
    assert np.sum((rows @ mesh.normals.ravel()) ** 2) == pytest.approx(slow_jump_energy(mesh))


def test_variation_of_a_sphere_vanishes_with_the_mesh_size_whatever_the_scale() -> None:
    energies = []
    for parts, radius in ((6, 1.0), (12, 1.0), (12, 0.01)):
        mesh = span_surface(octants(np.pi / 2 * radius / parts, radius), SurfaceParameters(refinement="off")).mesh
        on_sphere = normalised(mesh.vertices)
        rows = variation_rows(shape_of(mesh, radius * on_sphere, on_sphere), 0.3 * radius)
        energies.append(radius**2 * np.sum((rows @ on_sphere.ravel()) ** 2))
    assert energies[1] < energies[0] / 3
    assert energies[2] == pytest.approx(energies[1], rel=1e-4)  # symmetric patches may be meshed mirrored


def test_slopes_have_the_derivatives_of_their_jacobian() -> None:
    mesh, _ = linear(4)
    jacobian, residual, first, second = _system(shape_of(mesh), 0.3, 0.25)
    step = 1e-6 * np.random.default_rng(1).normal(size=(len(mesh.vertices), 3))
    vertices = mesh.vertices + step[:, :1] * mesh.normals
    normals = mesh.normals + step[:, 1:2] * first + step[:, 2:] * second
    count = len(interior_edges(mesh.faces).start)
    i, j = interior_edges(mesh.faces).start, interior_edges(mesh.faces).end

    def slopes(v: Floats, n: Floats) -> Floats:
        return np.asarray(((v[j] - v[i]) * (n[i] + n[j])).sum(1))

    before, after = slopes(mesh.vertices, mesh.normals), slopes(vertices, normals)
    some = abs(before) > 1e-9
    change = (residual[-count:] / np.where(some, before, 1.0) * (after - before))[some]
    np.testing.assert_allclose(change, (jacobian @ step.ravel())[-count:][some], atol=1e-3 * abs(change).max())


def test_sphere_is_found_exactly() -> None:
    mesh = span_surface(octants(0.1)).mesh
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert abs(radius - 1).max() < 2e-4
    np.testing.assert_allclose(mesh.mean_curvature, 1, atol=0.02)


def test_data_stay_and_no_triangle_turns_over() -> None:
    mesh, fixed = linear()
    refined = refine(mesh.vertices, mesh.normals, mesh.faces, mesh.patch, fixed)
    np.testing.assert_array_equal(refined.vertices[:fixed], mesh.vertices[:fixed])
    np.testing.assert_array_equal(refined.normals[:fixed], mesh.normals[:fixed])
    np.testing.assert_allclose(np.linalg.norm(refined.normals, axis=1), 1)
    assert np.isfinite(refined.evidence)


def test_noise_in_the_normals_is_no_evidence() -> None:
    """What the network itself leaves open must not decide for the refined surface."""
    mesh, fixed = linear()
    clean = refine(mesh.vertices, mesh.normals, mesh.faces, mesh.patch, fixed)
    noise = 0.1 * np.random.default_rng(0).normal(size=mesh.normals.shape)
    noisy = refine(mesh.vertices, normalised(mesh.normals + noise), mesh.faces, mesh.patch, fixed)
    assert noisy.evidence < 0.1 * clean.evidence
