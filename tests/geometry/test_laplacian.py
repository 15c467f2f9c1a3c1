"""Laws of the Laplacian, the curvature, the unrolling and the edge tables on meshes with exact answers."""

import numpy as np
import pytest
import robust_laplacian

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.curvature import gaussian_curvature, mean_curvature, normalised, sphere_normals
from tracemesh.geometry.surfaces.edges import boundary_vertices, interior_edges, unique_edges
from tracemesh.geometry.surfaces.flattening import flatten, holes_filled
from tracemesh.geometry.surfaces.laplacian import cotangent_laplacian, surface_laplacian, triangle_areas
from tracemesh.geometry.surfaces.quality import mesh_quality
from tracemesh.geometry.surfaces.triangulation import triangulate_polygon


def icosphere(steps: int) -> tuple[Floats, Ints]:
    """Unit sphere: an octahedron, subdivided."""
    vertices = np.vstack([np.eye(3), -np.eye(3)])
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    for _ in range(steps):
        edges, number = np.unique(
            np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1),
            axis=0,
            return_inverse=True,
        )
        middle = len(vertices) + number.reshape(-1, 3)
        middles = vertices[edges].sum(1)
        vertices = np.vstack([vertices, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
        corner = [np.column_stack([faces[:, k], middle[:, k], middle[:, k - 1]]) for k in range(3)]
        faces = np.vstack([*corner, middle])
    return vertices, faces


def disk() -> tuple[Floats, Ints]:
    turn = 2 * np.pi * np.arange(40) / 40
    loop = np.column_stack([np.cos(turn), np.sin(turn)])
    inside, faces = triangulate_polygon(loop, 0.16)
    return np.vstack([loop, inside]), faces


def slow_stiffness(vertices: Floats, faces: Ints) -> Floats:
    """The cotangent formula, corner by corner."""
    total = np.zeros((len(vertices), len(vertices)))
    for face in faces:
        for k in range(3):
            tip, i, j = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            a, b = vertices[i] - vertices[tip], vertices[j] - vertices[tip]
            weight = 0.5 * (a @ b) / np.linalg.norm(np.cross(a, b))
            for row, column, sign in ((i, j, 1), (j, i, 1), (i, i, -1), (j, j, -1)):
                total[row, column] += sign * weight
    return total


def test_stiffness_equals_the_slow_formula() -> None:
    vertices, faces = icosphere(2)
    stiffness = cotangent_laplacian(vertices[faces], faces, len(vertices)).stiffness
    np.testing.assert_allclose(stiffness.toarray(), slow_stiffness(vertices, faces), atol=1e-12)


def test_linear_functions_are_harmonic_and_mass_is_the_area() -> None:
    points, faces = disk()
    laplacian = cotangent_laplacian(points[faces], faces, len(points))
    residual = laplacian.stiffness @ (points @ [2.0, -3.0] + 1)
    np.testing.assert_allclose(residual[~boundary_vertices(faces, len(points))], 0, atol=1e-12)
    assert laplacian.mass.sum() == pytest.approx(triangle_areas(points[faces]).sum())


def test_laplacian_of_a_delaunay_mesh_is_the_intrinsic_one() -> None:
    vertices, faces = icosphere(3)
    ours, (theirs, _) = surface_laplacian(vertices, faces), robust_laplacian.mesh_laplacian(vertices, faces)
    assert abs(ours.stiffness + theirs).max() < 1e-3


def test_laplacian_of_any_mesh_has_no_negative_weights() -> None:
    vertices, faces = icosphere(3)
    squeezed = vertices * [1.0, 1.0, 0.05]
    off_diagonal = surface_laplacian(squeezed, faces).stiffness.toarray() * (1 - np.eye(len(vertices)))
    plain = cotangent_laplacian(squeezed[faces], faces, len(vertices)).stiffness.toarray() * (1 - np.eye(len(vertices)))
    assert plain.min() < -0.1
    assert off_diagonal.min() > -1e-6


@pytest.mark.parametrize("radius", [0.5, 3.0])
def test_mean_curvature_of_spheres(radius: float) -> None:
    vertices, faces = icosphere(4)
    curvature = mean_curvature(radius * vertices, faces, vertices)
    np.testing.assert_allclose(curvature, 1 / radius, rtol=2e-3)


def test_mean_curvature_keeps_its_sign() -> None:
    """Seen from inside a sphere is a hollow; a saddle has none."""
    vertices, faces = icosphere(4)
    np.testing.assert_allclose(mean_curvature(vertices, faces[:, ::-1], -vertices), -1, rtol=2e-3)
    points, flat_faces = disk()
    x, y = 0.3 * points.T
    saddle = np.column_stack([x, y, x * y])
    normals = np.column_stack([-y, -x, np.ones_like(x)]) / np.sqrt(1 + x**2 + y**2)[:, None]
    inside = ~boundary_vertices(flat_faces, len(points))
    assert abs(mean_curvature(saddle, flat_faces, normals)[inside]).max() < 0.05


@pytest.mark.parametrize("side", [1, -1])
def test_gaussian_curvature_of_spheres_seen_from_either_side(side: int) -> None:
    vertices, faces = icosphere(3)
    curvature = gaussian_curvature(3 * vertices, faces[:, ::side], side * vertices)
    np.testing.assert_allclose(curvature, 1 / 9, rtol=1e-12)


def curved_torus(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces, normals, mean and Gaussian curvature of a torus, R = 1, r = 0.4, with shuffled diagonals."""
    one, other = np.meshgrid(np.arange(2 * count), np.arange(count), indexing="ij")
    u, v = (np.pi / count * one).ravel(), (2 * np.pi / count * other).ravel()
    outward = np.column_stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)])
    vertices = np.column_stack([np.cos(u), np.sin(u), 0 * u]) + 0.4 * outward

    def corner(i: int, j: int) -> np.ndarray:
        return ((one + i) % (2 * count) * count + (other + j) % count).ravel()

    a, b, c, d = corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)
    swapped = np.random.default_rng(0).random(len(a)) < 0.5
    a, b, c, d = (np.where(swapped, x, y) for x, y in ((b, a), (c, b), (d, c), (a, d)))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    across = np.cos(v) / (1 + 0.4 * np.cos(v))
    return vertices, faces, outward, (across + 1 / 0.4) / 2, across / 0.4


def test_curvatures_of_a_torus_converge_on_a_mesh_without_order() -> None:
    """Saddles and hollows included; an angle defect over an area would not converge here."""
    errors = []
    for count in (16, 32, 64):
        vertices, faces, normals, mean, gaussian = curved_torus(count)
        found = mean_curvature(vertices, faces, normals) - mean, gaussian_curvature(vertices, faces, normals) - gaussian
        errors.append([np.sqrt(np.mean(e**2)) for e in found])
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert order.min() > 0.9
    assert max(errors[-1]) < 0.05


def test_total_gaussian_curvature_is_the_euler_number() -> None:
    """Gauss-Bonnet: 4 pi on a sphere, 0 on a torus."""
    vertices, faces, normals, _, _ = curved_torus(64)
    area = cotangent_laplacian(vertices[faces], faces, len(vertices)).mass
    assert abs(area @ gaussian_curvature(vertices, faces, normals)) < 0.01
    vertices, faces = icosphere(4)
    area = cotangent_laplacian(vertices[faces], faces, len(vertices)).mass
    assert area @ gaussian_curvature(vertices, faces, vertices) == pytest.approx(4 * np.pi, rel=5e-3)


def test_gaussian_curvature_on_an_open_boundary_is_that_of_the_faces_there() -> None:
    points, faces = disk()
    x, y = 0.3 * points.T
    saddle = np.column_stack([x, y, x * y])
    steep = 1 + x**2 + y**2
    normals = np.column_stack([-y, -x, np.ones_like(x)]) / np.sqrt(steep)[:, None]
    error = gaussian_curvature(saddle, faces, normals) + 1 / steep**2
    assert abs(error).max() < 0.03


def test_unrolling_a_cylinder_is_isometric() -> None:
    points, faces = disk()
    rolled = np.column_stack([np.sin(points[:, 0]), np.cos(points[:, 0]), points[:, 1]])
    start = np.column_stack([np.sin(points[:, 0]), points[:, 1]])
    flat = flatten(rolled, faces, start, np.array([0]))
    edges = unique_edges(faces)[0]
    lengths = [np.linalg.norm(p[edges[:, 1]] - p[edges[:, 0]], axis=1) for p in (flat, rolled)]
    np.testing.assert_allclose(*lengths, rtol=5e-3)


def test_edge_tables_agree_with_counting() -> None:
    for vertices, faces in (icosphere(2), disk()):
        count = unique_edges(faces)[1]
        inner = interior_edges(faces)
        assert len(inner.start) == (count == 2).sum()
        rows = [set(map(int, faces[f])) for f in inner.left], [set(map(int, faces[f])) for f in inner.right]
        for k in range(len(inner.start)):
            pair = {int(inner.start[k]), int(inner.end[k])}
            assert rows[0][k] == pair | {int(inner.left_tip[k])}
            assert rows[1][k] == pair | {int(inner.right_tip[k])}
        assert boundary_vertices(faces, len(vertices)).sum() == (count == 1).sum()


def test_quality_of_an_octahedron() -> None:
    vertices, faces = icosphere(0)
    quality = mesh_quality(vertices, faces, vertices)
    assert (quality.euler_number, quality.boundary_loops, quality.inverted_faces) == (2, 0, 0)
    assert quality.min_angle_deg == pytest.approx(60)
    assert mesh_quality(vertices, faces[1:], vertices).boundary_loops == 1


def test_normals_from_positions_are_exact_on_any_mesh_of_a_sphere() -> None:
    vertices, faces = icosphere(3)
    uneven = normalised(vertices + 0.03 * np.random.default_rng(2).normal(size=vertices.shape))
    np.testing.assert_allclose(sphere_normals(5 * uneven + 1, faces), uneven, atol=1e-12)


@pytest.mark.parametrize("holes", [0, 1, 2])
def test_filling_holes_makes_disks_again(holes: int) -> None:
    """Two patches beside each other: every hole closed by one more vertex, outer boundaries left alone."""
    plane, triangles = disk()
    first = int(np.flatnonzero((triangles >= 40).all(1))[0])
    far = int(np.flatnonzero((triangles >= 40).all(1) & ~np.isin(triangles, triangles[first]).any(1))[0])
    open_ = np.delete(triangles, [first, far][:holes], axis=0)
    planar = np.vstack([plane, plane + 5])
    vertices = np.column_stack([planar, planar[:, 0] ** 2])
    faces, patch = np.vstack([open_, open_ + len(plane)]), np.repeat([0, 1], len(plane))

    filled, closed, places = holes_filled(vertices, faces, planar, patch)
    assert len(filled) == len(places) == len(vertices) + 2 * holes
    np.testing.assert_array_equal(filled[: len(vertices)], vertices)
    np.testing.assert_array_equal(places[: len(planar)], planar)
    np.testing.assert_array_equal(closed[: len(faces)], faces)
    edges, beside_edge = unique_edges(closed)
    assert beside_edge.max() == 2
    assert len(filled) - len(edges) + len(closed) == 2
    (ax, ay), (bx, by) = (places[closed[:, k]].T - places[closed[:, 0]].T for k in (1, 2))
    doubled = ax * by - ay * bx
    assert (doubled > 0).all()
    assert doubled.sum() / 2 == pytest.approx(2 * 20 * np.sin(2 * np.pi / 40))
