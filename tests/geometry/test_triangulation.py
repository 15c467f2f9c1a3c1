"""Laws of the planar triangulation: covers the polygon, keeps its edges whole, well-shaped."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.errors import SurfaceError
from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.opening import opened
from tracemesh.geometry.surfaces.planar_maps import develop, map_to_circle, project_to_plane, signed_area
from tracemesh.geometry.surfaces.quality import triangle_angles
from tracemesh.geometry.surfaces.triangulation import triangulate_polygon


def circle(count: int) -> Floats:
    turn = 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(turn), np.sin(turn)])


def areas(points: Floats, faces: Ints) -> Floats:
    a, b, c = points[faces].transpose(1, 0, 2)
    return np.asarray((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def smallest_angle(points: Floats, faces: Ints) -> float:
    return float(np.degrees(triangle_angles(np.column_stack([points, np.zeros(len(points))]), faces).min()))


def assert_valid(loop: Floats, inside: Floats, faces: Ints) -> None:
    """Faces cover the polygon, turn left, use every point, and have exactly the polygon's edges as boundary."""
    points = np.vstack([loop, inside])
    assert (areas(points, faces) > 0).all()
    assert areas(points, faces).sum() == pytest.approx(signed_area(loop))
    assert np.array_equal(np.unique(faces), np.arange(len(points)))
    directed = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    boundary = {(a, b) for a, b in directed if (b, a) not in directed}
    assert boundary == {(k, (k + 1) % len(loop)) for k in range(len(loop))}


@given(st.lists(st.floats(0.6, 1.0), min_size=8, max_size=40), st.floats(0.3, 5.0))
@settings(max_examples=40, deadline=None)
def test_any_star_shaped_polygon(radii: list[float], factor: float) -> None:
    loop = circle(len(radii)) * np.array(radii)[:, None]
    spacing = factor * float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).mean())
    assert_valid(loop, *triangulate_polygon(loop, spacing))


@pytest.mark.parametrize("factor", [0.5, 1, 1.5, 2, 4, 8, 100])
@pytest.mark.parametrize("count", [12, 60, 200])
def test_angles_stay_open_at_every_grading(count: int, factor: float) -> None:
    loop = circle(count)
    inside, faces = triangulate_polygon(loop, factor * 2 * np.sin(np.pi / count))
    assert_valid(loop, inside, faces)
    assert smallest_angle(np.vstack([loop, inside]), faces) > 20


def test_number_of_points_follows_the_spacing() -> None:
    loop = circle(200)
    counts = [len(triangulate_polygon(loop, size)[0]) for size in (0.04, 0.02)]
    assert counts[1] / counts[0] == pytest.approx(4, rel=0.1)


def test_short_edges_do_not_close_angles() -> None:
    square = np.array([[x, 0.0] for x in np.arange(0, 1, 0.05)] + [[1, y] for y in np.arange(0, 1, 0.05)])
    loop = np.vstack([square, 1 - square])
    loop = np.insert(loop, 5, loop[4] + [0.006, 0], axis=0)
    inside, faces = triangulate_polygon(loop, 0.05)
    assert_valid(loop, inside, faces)
    assert smallest_angle(np.vstack([loop, inside]), faces) > 12


def test_no_inner_edge_joins_corners_of_the_loop() -> None:
    """A strip without room for inner points is split along its middle, so that the surface has freedom across it."""
    x = np.linspace(0, 1, 21)
    loop = np.vstack([np.column_stack([x, 0 * x]), np.column_stack([1 - x, 0 * x + 0.05])])
    faces = triangulate_polygon(loop, 0.05)[1]
    count = len(loop)
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    inner = edges[(edges < count).all(1)]
    assert set(((inner[:, 1] - inner[:, 0]) % count).tolist()) <= {1, count - 1}


def test_crossing_polygon_is_refused() -> None:
    with pytest.raises(SurfaceError, match="crosses or touches itself"):
        triangulate_polygon(np.array([[0.0, 0], [1, 1], [1, 0], [0, 1]]), 0.2)


def test_spacing_far_too_small_is_refused() -> None:
    with pytest.raises(SurfaceError, match="wanted a larger one"):
        triangulate_polygon(circle(20), 1e-6)


def test_maps_of_a_planar_loop_are_isometric() -> None:
    loop = circle(30) * [1.0, 0.4]
    points, normals = np.column_stack([loop, np.ones(30)]), np.tile([0.0, 0, 1], (30, 1))
    for plane in (project_to_plane(points, normals), develop(points, normals)):
        assert plane is not None
        distances = [np.linalg.norm(p[:, None] - p, axis=2) for p in (plane, loop)]
        np.testing.assert_allclose(*distances, atol=1e-9)
    assert signed_area(map_to_circle(points)) > 0


def test_normals_that_cancel_out_have_no_projection() -> None:
    points = np.column_stack([circle(30), np.zeros(30)])
    assert project_to_plane(points, points) is None


def test_opening_angles_never_narrows_them_nor_moves_what_is_fixed() -> None:
    loop = circle(24)
    inside, faces = triangulate_polygon(loop, 0.26)
    random = np.random.default_rng(1)
    points = np.vstack([loop, inside + random.uniform(-0.1, 0.1, inside.shape)])
    assert (areas(points, faces) > 0).all()
    moved = opened(points, faces, len(loop))
    np.testing.assert_array_equal(moved[: len(loop)], loop)
    assert_valid(loop, moved[len(loop) :], faces)
    assert smallest_angle(points, faces) < 17
    assert smallest_angle(moved, faces) > 20
