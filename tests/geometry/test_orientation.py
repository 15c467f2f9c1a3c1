"""Orientations from vectors against an SVD oracle, known poses, and what must be refused."""

import numpy as np
import pytest

from tracemesh.errors import ScanError
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.sensing.orientation import (
    ReferenceField,
    frames_from_quaternions,
    frames_from_vectors,
    two_vector_rotations,
    vector_quality,
    wahba,
)

FIELD = ReferenceField()


def svd_oracle(measured: np.ndarray, reference: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Kabsch: the rotation that minimises sum w |r - A m|^2, one sample at a time."""
    rotations = []
    for m in measured:
        u, _, vt = np.linalg.svd(np.einsum("k,ki,kj->ij", weights, reference, m))
        rotations.append(u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt)
    return np.array(rotations)


def unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_davenport_solves_wahbas_problem(count: int) -> None:
    random = np.random.default_rng(count)
    reference, weights = unit(random.standard_normal((count, 3))), random.uniform(0.2, 3, count)
    frames = exp(random.standard_normal((40, 3)))
    measured = unit(np.einsum("nij,ki->nkj", frames, reference) + 0.1 * random.standard_normal((40, count, 3)))
    np.testing.assert_allclose(
        wahba(measured, reference, weights), svd_oracle(measured, reference, weights), atol=1e-12
    )


def test_the_closed_form_for_two_vectors_is_davenports() -> None:
    random = np.random.default_rng(0)
    a, m = random.standard_normal((2, 500, 3))
    reference = np.array([FIELD.acceleration, FIELD.magnetic])
    expected = wahba(np.stack([a, m], axis=1), reference)
    np.testing.assert_allclose(two_vector_rotations(a, m, FIELD), expected, atol=1e-12)


def test_exact_vectors_of_any_length_give_the_frame_back() -> None:
    frames = exp(2 * np.random.default_rng(1).standard_normal((30, 3)))
    mounting = exp(np.array([0.3, -1.0, 2.0]))
    device = frames @ mounting.T  # device -> world
    acceleration, magnetic = 9.81 * (FIELD.acceleration @ device), 48e-6 * (FIELD.magnetic @ device)
    np.testing.assert_allclose(frames_from_vectors(acceleration, magnetic, FIELD, mounting), frames, atol=1e-12)


def test_a_phone_lying_flat_with_its_top_to_the_west() -> None:
    half = np.sqrt(0.5)
    frame = frames_from_quaternions(np.array([[half, 0, 0, half]]))[0]
    np.testing.assert_allclose(frame @ [0, 1, 0], [-1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(frames_from_quaternions(np.array([[-2 * half, 0, 0, -2 * half]]))[0], frame, atol=1e-15)


def test_quality_shows_a_disturbed_field() -> None:
    frames = exp(np.random.default_rng(2).standard_normal((21, 3)))
    acceleration, magnetic = FIELD.acceleration @ frames, FIELD.magnetic @ frames
    magnetic[5] *= 1.4
    magnetic[7] += 0.2 * acceleration[7]
    quality = vector_quality(acceleration, magnetic, FIELD)
    assert quality.magnetic_ratio[5] == pytest.approx(1.4)
    assert np.flatnonzero(abs(quality.angle_error) > 0.05).tolist() == [7]
    np.testing.assert_allclose(quality.acceleration_ratio, 1)


def test_reference_field_from_inclination() -> None:
    field = ReferenceField.from_inclination(np.radians(60))
    assert field.angle == pytest.approx(np.radians(150)) == pytest.approx(FIELD.angle)
    assert field.magnetic[1] > 0 > field.magnetic[2]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda a, m: a.__setitem__(3, np.nan), "acceleration: sample 4 is not a finite"),
        (lambda a, m: m.__setitem__(0, 0.0), "magnetic field: sample 1 is not a finite"),
        (lambda a, m: m.__setitem__(2, -2 * a[2]), "parallel at sample 3"),
    ],
)
def test_useless_vectors_are_refused(change: object, message: str) -> None:
    a, m = np.random.default_rng(3).standard_normal((2, 6, 3))
    change(a, m)  # type: ignore[operator]
    with pytest.raises(ScanError, match=message):
        frames_from_vectors(a, m, FIELD)


def test_useless_quaternions_shapes_and_mountings_are_refused() -> None:
    with pytest.raises(ScanError, match="quaternion 2 is zero"):
        frames_from_quaternions(np.array([[1.0, 0, 0, 0], [0, 0, 0, 0]]))
    with pytest.raises(ScanError, match="shape"):
        frames_from_quaternions(np.ones((3, 3)))
    with pytest.raises(ScanError, match="2 and 3"):
        frames_from_vectors(np.ones((3, 3)), np.eye(3)[:2], FIELD)
    with pytest.raises(ScanError, match="mounting"):
        frames_from_quaternions(np.array([[1.0, 0, 0, 0]]), np.diag([1.0, 1, -1]))
