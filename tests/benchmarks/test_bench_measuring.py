"""The benchmarks' own measures are exact on what is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.apart import apart
from benchmarks.measuring import (
    closest_motion,
    fitted_exponent,
    geometric_mean,
    mean_over_area,
    paired_motion,
    vertex_areas,
    warm_seconds,
)
from benchmarks.truths import CurveTruth, Field, MeshTruth, Sphere, Torus
from tracemesh.geometry.simulated.shapes import leaf


def test_exponent_and_mean_of_powers() -> None:
    assert fitted_exponent([1, 10, 100], [3, 3 * 10**1.5, 3 * 100**1.5]) == pytest.approx(1.5)
    assert fitted_exponent([1], [2]) is None
    assert geometric_mean([1, 10, 100]) == pytest.approx(10)


def test_warm_calls_once_more_than_it_counts() -> None:
    calls = []
    assert warm_seconds(lambda: calls.append(1), 3) >= 0
    assert len(calls) == 4


def test_motion_is_found_again() -> None:
    points = np.random.default_rng(1).normal(size=(20, 3))
    rotation = Rotation.from_rotvec([0.3, -1.2, 0.5]).as_matrix()
    targets = points @ rotation.T + np.array([1.0, -2.0, 3.0])
    motion = paired_motion(points, targets)
    assert motion.rotation == pytest.approx(rotation)
    assert motion.apply(points) == pytest.approx(targets)


def test_registration_undoes_a_small_motion_but_no_scale() -> None:
    network = leaf().network(0.02)
    truth = CurveTruth.of(leaf().network(0.002))
    turned = Rotation.from_rotvec([0.02, 0.01, -0.03]).apply(network.points) + np.array([0.4, 0.2, -0.1])
    moved = closest_motion(turned, truth.closest).apply(turned)
    assert truth.distance(moved).max() < 2e-5
    larger = closest_motion(1.1 * network.points, truth.closest).apply(1.1 * network.points)
    assert truth.distance(larger).mean() > 5e-3


def test_area_of_a_square_is_shared_by_its_corners() -> None:
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    assert vertex_areas(vertices, faces) == pytest.approx([4 / 3, 2 / 3, 4 / 3, 2 / 3])
    assert mean_over_area(np.array([1.0, 0, 0, 0]), vertices, faces) == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("truth", "off"),
    [(Sphere(), 0.05), (Torus(), 0.05), (Field(), 0.01)],
)
def test_truth_knows_its_own_points_and_others(truth: Sphere | Torus | Field, off: float) -> None:
    points = truth.samples()
    assert truth.distance(points).max() < 2e-3  # chords of the mesh that they come from
    tree = MeshTruth(points, np.arange(len(points) // 3 * 3).reshape(-1, 3))
    assert tree.diagonal == pytest.approx(truth.diagonal, rel=0.2)
    assert truth.distance(points + np.array([0, 0, off])).max() == pytest.approx(off, rel=0.05)


def test_distance_to_a_mesh_and_to_curves() -> None:
    square = MeshTruth(np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    assert square.distance(np.array([[1.0, 0.5, 0.3], [3.0, 1.0, 0.0]])) == pytest.approx([0.3, 1.0])
    edge = CurveTruth(np.array([[0.0, 0, 0]]), np.array([[2.0, 0, 0]]))
    assert edge.distance(np.array([[1.0, 0.5, 0.0], [-1.0, 0.0, 0.0]])) == pytest.approx([0.5, 1.0])


def test_work_apart_returns_and_is_stopped() -> None:
    measured = apart(60.0, geometric_mean, [2.0, 8.0])
    assert measured is not None
    assert measured.result == pytest.approx(4)
    assert measured.memory is None or measured.memory >= 0
    assert apart(0.0, geometric_mean, [2.0, 8.0]) is None
    assert apart(60.0, geometric_mean, []) is None
