"""Closest points: the same as a scan over all triangles by a generic solver, for triangles of any size and shape."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.geometry.comparison.closest import ClosestPoints, closest_on_triangles
from tracemesh.geometry.simulated.shapes import leaf


def slow_distance(point: np.ndarray, corners: np.ndarray) -> float:
    """Distance to one triangle, by a fine search over it that closes in on the best place."""
    best, size = np.array([1 / 3, 1 / 3]), 1.0
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 21)] * 2), axis=-1).reshape(-1, 2)
    for _ in range(40):
        trial = np.clip(best + size * grid, 0, 1)
        trial = trial[trial.sum(axis=1) <= 1 + 1e-12]
        edge = np.column_stack([np.clip(best[0] + size * grid[:, 0], 0, 1)])
        trial = np.concatenate([trial, np.column_stack([edge, 1 - edge])])
        places = corners[0] + trial @ (corners[1:] - corners[0])
        best = trial[np.linalg.norm(places - point, axis=1).argmin()]
        size *= 0.6
    return float(np.linalg.norm(corners[0] + best @ (corners[1:] - corners[0]) - point))


coordinates = st.integers(-5, 5).map(float)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)


@settings(max_examples=60, deadline=None)
@given(points, st.lists(points, min_size=3, max_size=3).map(np.array))
def test_one_triangle(point: np.ndarray, corners: np.ndarray) -> None:
    weights = closest_on_triangles(point[None], corners[None])[0]
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(), 1, atol=1e-12)
    distance = np.linalg.norm(weights @ corners - point)
    np.testing.assert_allclose(distance, slow_distance(point, corners), atol=1e-6)


def test_a_mesh_of_triangles_of_very_different_size() -> None:
    generator = np.random.default_rng(4)
    size = 10.0 ** generator.uniform(-4, 0, 400)
    corners = generator.uniform(-1, 1, (400, 1, 3)) + size[:, None, None] * generator.normal(size=(400, 3, 3))
    queries = generator.uniform(-2, 2, (150, 3))
    faces = np.arange(1200).reshape(-1, 3)
    closest = ClosestPoints(corners.reshape(-1, 3), faces)
    weights, distance, face = closest(queries)
    everything = closest_on_triangles(np.repeat(queries, 400, axis=0), np.tile(corners, (150, 1, 1)))
    places = np.einsum("nk,nki->ni", everything, np.tile(corners, (150, 1, 1))).reshape(150, 400, 3)
    np.testing.assert_allclose(distance, np.linalg.norm(places - queries[:, None], axis=2).min(axis=1), atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(closest.at(weights, face) - queries, axis=1), distance, atol=1e-13)


def test_points_of_the_mesh_are_their_own_closest_points() -> None:
    vertices, faces = leaf().mesh(10)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], len(faces))
    inside = np.einsum("nk,nki->ni", weights, vertices[faces])
    found, distance, face = ClosestPoints(vertices, faces)(inside)
    assert distance.max() < 1e-15
    assert face.tolist() == list(range(len(faces)))
    np.testing.assert_allclose(found, weights, atol=1e-12)
