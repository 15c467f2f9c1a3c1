"""Registration finds the motion that was hidden, and ends in a true minimum of the sum of squared distances."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.comparison.registration import register
from tracemesh.geometry.simulated.shapes import SHAPES, leaf

VERTICES, FACES = leaf().mesh(16)


def on_surface(count: int) -> np.ndarray:
    generator = np.random.default_rng(1)
    face = generator.integers(len(FACES), size=count)
    return np.einsum("nk,nki->ni", generator.dirichlet([1, 1, 1], count), VERTICES[FACES[face]])


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.5, 3.1])
@pytest.mark.parametrize("scale", [1.0, 0.2])
def test_a_hidden_motion_is_found(angle: float, scale: float) -> None:
    points = on_surface(300)
    turn = Rotation.from_rotvec(np.array([0.5, -0.3, 0.8]) * angle).as_matrix()
    moved = scale * points @ turn.T + [5.0, -2.0, 1.0]
    found = register(moved, VERTICES, FACES, scaled=scale != 1.0)
    np.testing.assert_allclose(found.apply(moved), points, atol=1e-6)
    np.testing.assert_allclose(found.scale, 1 / scale, rtol=1e-5)
    np.testing.assert_allclose(found.rotation, turn.T, atol=1e-5)


def test_it_ends_in_a_minimum_of_the_sum_of_squares() -> None:
    noisy = on_surface(400) + np.random.default_rng(2).normal(0, 0.005, (400, 3))
    closest = ClosestPoints(VERTICES, FACES)
    placed = register(noisy, VERTICES, FACES).apply(noisy)
    least = np.sum(closest(placed)[1] ** 2)
    for axis in np.eye(3):
        for amount in (-1e-4, 1e-4):
            turned = Rotation.from_rotvec(axis * amount).apply(placed - placed.mean(axis=0)) + placed.mean(axis=0)
            assert np.sum(closest(turned)[1] ** 2) > least
            assert np.sum(closest(placed + axis * amount)[1] ** 2) > least


def test_points_to_spare_at_the_rim_pull_as_they_should() -> None:
    """A strip that is wider than the mesh hangs over by the same on both sides."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    x, y = np.meshgrid(np.linspace(-0.1, 1.1, 25), np.linspace(0.0, 1.0, 11))
    points = np.column_stack([x.ravel() + 0.05, y.ravel() + 0.02, np.zeros(x.size)])
    placed = register(points, vertices, np.array([[0, 1, 2], [0, 2, 3]])).apply(points)
    assert placed[:, 0].min() == pytest.approx(-0.1, abs=1e-4)
    assert placed[:, 0].max() == pytest.approx(1.1, abs=1e-4)


@pytest.mark.parametrize("name", ["sphere", "cone"])
def test_surfaces_that_slide_along_themselves_do_not_hurt(name: str) -> None:
    shape = SHAPES[name]()
    vertices, faces = shape.mesh(32)
    points = shape.network(0.05).points
    turned = Rotation.from_rotvec([0.1, 0.2, 0.1]).apply(points)
    placed = register(turned, vertices, faces).apply(turned)
    assert ClosestPoints(vertices, faces)(placed)[1].max() < 2e-4


def test_a_scale_does_not_shrink_points_that_do_not_fit() -> None:
    cloud = np.random.default_rng(3).normal(size=(60, 3))
    assert register(cloud, *leaf().mesh(6), scaled=True).scale * np.ptp(cloud, axis=0).max() > 0.1
