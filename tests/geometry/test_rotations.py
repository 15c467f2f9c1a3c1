"""Rotations: inverse pairs, scipy as oracle, the group's laws near the identity and near half a turn."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracemesh.geometry.rotations import (
    align_signs,
    darboux_frames,
    exp,
    hat,
    log,
    matrix_to_quaternion,
    quaternion_difference,
    quaternion_product,
    quaternion_to_matrix,
    skew_vector,
)

SIZES = (0.0, 1e-9, 1e-5, 9e-5, 1.1e-4, 1e-2, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-9)


def vectors(size: float, count: int = 50, seed: int = 0) -> np.ndarray:
    v = np.random.default_rng(seed).standard_normal((count, 3))
    return size * v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("size", SIZES)
def test_log_undoes_exp(size: float) -> None:
    np.testing.assert_allclose(log(exp(vectors(size))), vectors(size), atol=2e-15 + 4e-9 * (size > 3.1), rtol=1e-9)


@pytest.mark.parametrize("size", SIZES)
def test_exp_is_scipys(size: float) -> None:
    np.testing.assert_allclose(exp(vectors(size)), Rotation.from_rotvec(vectors(size)).as_matrix(), atol=1e-15)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-10, 10), min_size=6, max_size=6))
def test_hat_is_the_cross_product_and_skew_vector_its_inverse(numbers: list[float]) -> None:
    a, b = np.array(numbers[:3]), np.array(numbers[3:])
    np.testing.assert_allclose(hat(a) @ b, np.cross(a, b), atol=1e-12)
    np.testing.assert_allclose(skew_vector(hat(a)), 2 * a, atol=1e-12)


@pytest.mark.parametrize("size", SIZES)
def test_quaternions_and_matrices_are_one(size: float) -> None:
    matrix = exp(vectors(size))
    q = matrix_to_quaternion(matrix)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(quaternion_to_matrix(q), matrix, atol=2e-15)
    np.testing.assert_allclose(
        matrix, Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix(), atol=2e-15
    )  # scipy has w last


def test_product_and_difference_follow_the_matrices() -> None:
    a, b = exp(vectors(2.0, seed=1)), exp(vectors(1.5, seed=2))
    p, q = matrix_to_quaternion(a), matrix_to_quaternion(b)
    np.testing.assert_allclose(quaternion_to_matrix(quaternion_product(p, q)), a @ b, atol=1e-14)
    for sign in (1, -1):
        np.testing.assert_allclose(exp(quaternion_difference(sign * p, q)), a @ np.swapaxes(b, 1, 2), atol=1e-14)


def test_align_signs_makes_a_path_without_jumps() -> None:
    path = exp(np.linspace(0, 12, 200)[:, None] * np.array([[0.6, 0.0, 0.8]]))
    q = matrix_to_quaternion(path) * np.random.default_rng(0).choice([-1, 1], (200, 1))
    aligned = align_signs(q)
    assert (np.sum(aligned[1:] * aligned[:-1], axis=1) > 0.99).all()
    np.testing.assert_allclose(quaternion_to_matrix(aligned), path, atol=1e-14)


def test_darboux_frames_keep_the_normal_and_are_rotations() -> None:
    tangent, normal = vectors(1.0, seed=3), vectors(2.0, seed=4)
    frames = darboux_frames(tangent, normal)
    np.testing.assert_allclose(np.swapaxes(frames, 1, 2) @ frames, np.broadcast_to(np.eye(3), frames.shape), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(frames), 1, atol=1e-13)
    np.testing.assert_allclose(frames[:, :, 1], normal / 2, atol=1e-15)
    assert (np.sum(frames[:, :, 0] * tangent, axis=1) > 0).all()
