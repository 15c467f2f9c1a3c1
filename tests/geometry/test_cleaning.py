"""Cleaning: planted outliers are found, good samples kept, duplicates averaged, unusable curves refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.cleaning import clean_curve, merge_duplicates, outliers
from tracemesh.geometry.rotations import align_signs, exp, matrix_to_quaternion
from tracemesh.geometry.scan import CurveScan
from tracemesh.geometry.sensing.orientation import ReferenceField, frames_from_vectors
from tracemesh.geometry.simulated.shapes import SHAPES


def curve_scan(samples: int = 400) -> CurveScan:
    curve = SHAPES["leaf"]().curves[1]
    distance = np.linspace(0, curve.length, samples)
    frames = curve.at(distance)[1]
    return CurveScan(distance, frames[:, :, 0], frames[:, :, 1], np.array([0, samples - 1]), np.array([0, 1]))


def frames_of(curve: CurveScan) -> np.ndarray:
    return np.stack([curve.tangent, curve.normal, np.cross(curve.tangent, curve.normal)], axis=-1)


def quaternions(curve: CurveScan) -> np.ndarray:
    return align_signs(matrix_to_quaternion(frames_of(curve)))


def with_frames(curve: CurveScan, frames: np.ndarray) -> CurveScan:
    return replace(curve, tangent=frames[:, :, 0].copy(), normal=frames[:, :, 1].copy())


def spoiled(part: float, seed: int = 0) -> tuple[CurveScan, np.ndarray]:
    """Noisy vectors of which a part is pure chance, as a scan, and which ones."""
    random = np.random.default_rng(seed)
    curve, field = curve_scan(2000), ReferenceField()
    frames = frames_of(curve)
    references = np.array([field.acceleration, field.magnetic])
    vectors = [e @ frames + 0.015 * random.standard_normal((2000, 3)) for e in references]
    bad = random.random(2000) < part
    for v in vectors:
        v[bad] = random.standard_normal((bad.sum(), 3))
    measured = with_frames(curve, frames_from_vectors(*vectors, field))
    return replace(measured, acceleration=vectors[0], magnetic=vectors[1]), bad


def angle_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(2 * np.arccos(np.clip(abs(np.sum(a * b, axis=1)), 0, 1)))


@pytest.mark.parametrize("part", [0.004, 0.05])
def test_the_worst_frame_that_is_left_is_nearly_as_good_as_the_noise(part: float) -> None:
    curve, bad = spoiled(part)
    found = outliers(curve, frames_of(curve))
    error = angle_deg(quaternions(curve), quaternions(curve_scan(2000)))
    assert error[bad].max() > 90
    assert error[~found].max() < 1.5 * error[~bad].max()
    assert found[~bad].mean() < 0.01


def test_frames_alone_show_outliers_too() -> None:
    curve, bad = spoiled(0.01)
    alone = replace(curve, acceleration=None, magnetic=None)
    found = outliers(alone, frames_of(alone))
    error = angle_deg(quaternions(curve), quaternions(curve_scan(2000)))
    assert error[~found].max() < 1.5 * error[~bad].max()


@pytest.mark.parametrize("samples", [5, 20, 400])
def test_nothing_is_dropped_from_an_exact_curve(samples: int) -> None:
    assert clean_curve(curve_scan(samples), 0).dropped == 0


def test_equal_distances_are_averaged_as_markley_does() -> None:
    random = np.random.default_rng(1)
    frames = exp(np.array([0.3, 1.0, -0.4])) @ exp(0.03 * random.standard_normal((60, 3)))
    q = align_signs(matrix_to_quaternion(frames))
    markley = np.linalg.eigh(q.T @ q)[1][:, 3]
    distance, mean = merge_duplicates(np.full(60, 0.25), q)
    assert distance.tolist() == [0.25]
    assert angle_deg(mean / np.linalg.norm(mean), markley[None])[0] < 0.002


def test_pauses_and_short_reversals_give_increasing_distances() -> None:
    curve = curve_scan(100)
    distance = curve.distance.copy()
    distance[40:50] = distance[40]
    distance[60:64] = distance[60:64][::-1]
    cleaned = clean_curve(replace(curve, distance=distance), 0)
    assert (np.diff(cleaned.distance) > 0).all()
    assert len(cleaned.distance) == 91
    np.testing.assert_array_equal(cleaned.marks, curve.distance[[0, 99]])


def change(**fields: object) -> CurveScan:
    return replace(curve_scan(10), **fields)


def spoil(name: str, value: object) -> CurveScan:
    array = np.array(getattr(curve_scan(10), name))
    array[4] = value
    return change(**{name: array})


@pytest.mark.parametrize(
    ("curve", "message"),
    [
        (spoil("tangent", np.nan), "curve 3: the tangent of sample 5 is not finite"),
        (spoil("normal", 0.0), "curve 3: the normal of sample 5 is zero"),
        (spoil("distance", np.inf), "curve 3: the distance of sample 5 is not finite"),
        (change(normal=curve_scan(10).tangent), "curve 3: tangent and normal of sample 1 are parallel"),
        (change(normal=np.ones((9, 3))), "curve 3: wanted 10 normals of three numbers"),
        (
            change(distance=np.full(10, 2.0), node_samples=np.array([0]), node_ids=np.array([1])),
            "curve 3 has no length",
        ),
        (change(node_samples=np.array([0, 10])), "curve 3: node 1 is marked at sample 11 of 10"),
        (change(node_samples=np.array([9, 0])), "not in increasing order"),
        (change(node_samples=np.array([0])), "1 samples are marked as nodes, but 2"),
        (change(node_samples=np.array([4, 4])), "no distance was travelled from node 0 to node 1"),
        (change(closed=True), "curve 3 is closed, but begins at node 0 and ends at node 1"),
    ],
)
def test_unusable_curves_are_refused_by_name(curve: CurveScan, message: str) -> None:
    with pytest.raises(ScanError, match=message):
        clean_curve(curve, 2)


@pytest.mark.parametrize("count", [0, 1])
def test_a_curve_needs_two_samples(count: int) -> None:
    none = np.empty(0, np.int64)
    with pytest.raises(ScanError, match=f"curve 1 has {count} sample"):
        clean_curve(CurveScan(np.zeros(count), np.ones((count, 3)), np.ones((count, 3)), none, none), 0)
