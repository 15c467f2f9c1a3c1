"""Raw sensors become orientations: exact at rest in every pose, near the truth in motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from tracemesh.errors import ScanError
from tracemesh.geometry.sensing.fusion import frames_from_imu
from tracemesh.geometry.sensing.orientation import ReferenceField, frames_from_vectors

Floats = NDArray[np.float64]
INCLINATION = np.radians(61.0)
FIELD = 47.0 * np.array([0.0, np.cos(INCLINATION), -np.sin(INCLINATION)])
UP = np.array([0.0, 0.0, 9.80665])


def degrees_off(frames: Floats, true: Rotation) -> Floats:
    angle: Floats = np.degrees((Rotation.from_matrix(frames) * true.inv()).magnitude())
    return angle


def at_rest(pose: Rotation, count: int = 100) -> tuple[Floats, Floats, Floats, Floats]:
    acceleration, magnetic = (np.tile(pose.inv().apply(v), (count, 1)) for v in (UP, FIELD))
    return np.arange(count) / 60, np.zeros((count, 3)), acceleration, magnetic


def moved(seconds: float, seed: int) -> tuple[tuple[Floats, Floats, Floats, Floats], Rotation]:
    """A hand that turns and shakes a phone with noise, a bias and uneven times; and how it truly turned."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 1.5, int(60 * seconds))) / 60
    knots = np.linspace(0, time[-1] + 0.1, int(seconds) + 3)
    turns = np.cumsum(rng.normal(0, 0.5, (len(knots), 3)), axis=0) * [0.3, 0.3, 1.0]
    path = RotationSpline(knots, Rotation.from_rotvec(turns))
    pose = path(time)
    rate = (pose.inv() * path(time + 1e-5)).as_rotvec() / 1e-5
    beats = np.linspace(0, time[-1] + 0.1, int(2 * seconds) + 4)
    shaken = CubicSpline(beats, rng.normal(0, 0.05, (len(beats), 3)))(time, 2)
    acceleration = pose.inv().apply(UP + shaken) + rng.normal(0, 0.05, (len(time), 3))
    magnetic = pose.inv().apply(FIELD) + rng.normal(0, 0.5, (len(time), 3))
    return (time, rate + rng.normal(0, 0.005, rate.shape) + [0.01, -0.005, 0.008], acceleration, magnetic), pose


def test_flat_with_its_top_to_magnetic_north_is_the_world_itself() -> None:
    np.testing.assert_allclose(
        frames_from_imu(*at_rest(Rotation.identity())), np.tile(np.eye(3), (100, 1, 1)), atol=1e-5
    )


def test_a_quarter_turn_to_the_left_points_the_top_west() -> None:
    frames = frames_from_imu(*at_rest(Rotation.from_euler("z", 90, degrees=True)))
    np.testing.assert_allclose(frames[:, :, 1], np.tile([-1.0, 0.0, 0.0], (100, 1)), atol=1e-5)


@pytest.mark.parametrize(
    "pose", list(Rotation.create_group("O")), ids=lambda p: str(np.rint(p.as_rotvec(degrees=True)))
)
def test_every_face_and_quarter_turn_is_exact_at_rest(pose: Rotation) -> None:
    assert degrees_off(frames_from_imu(*at_rest(pose)), pose).max() < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_a_moving_hand_disturbs_it_far_less_than_vectors_alone(seed: int) -> None:
    sensors, truth = moved(10.0, seed)
    fused = degrees_off(frames_from_imu(*sensors), truth)
    alone = degrees_off(frames_from_vectors(*sensors[2:], ReferenceField.from_inclination(INCLINATION)), truth)
    assert np.sqrt(np.mean(fused**2)) < 3.0
    assert np.sqrt(np.mean(fused**2)) < np.sqrt(np.mean(alone**2)) / 3


@settings(max_examples=10, deadline=None)
@given(acceleration=st.floats(1e-3, 1e3), magnetic=st.floats(1e-3, 1e3), later=st.floats(0, 1e6))
def test_units_of_the_vectors_and_the_clocks_zero_do_not_matter(
    acceleration: float, magnetic: float, later: float
) -> None:
    (time, rate, up, field), _ = moved(3.0, 0)
    other = frames_from_imu(time + later, rate, acceleration * up, magnetic * field)
    np.testing.assert_allclose(other, frames_from_imu(time, rate, up, field), atol=1e-5)


def test_after_a_silence_it_begins_anew() -> None:
    (time, *signals), truth = moved(6.0, 1)
    half = len(time) // 2
    later = np.where(np.arange(len(time)) < half, time, time + 60)
    parts = [frames_from_imu(time[p], *(s[p] for s in signals)) for p in (slice(half), slice(half, None))]
    whole = frames_from_imu(later, *signals)
    np.testing.assert_allclose(whole, np.concatenate(parts), atol=0.02)
    assert degrees_off(whole, truth).mean() < 4.0


def test_a_mounting_turns_the_devices_axes_into_the_frame() -> None:
    mounting = Rotation.from_euler("xyz", [0.3, -0.5, 1.1]).as_matrix()
    sensors, _ = moved(2.0, 2)
    np.testing.assert_allclose(frames_from_imu(*sensors, mounting), frames_from_imu(*sensors) @ mounting, atol=1e-12)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        (0, -1.0, "clock runs backwards after sample 5"),
        (0, np.nan, "clock runs backwards after sample 5"),
        (1, np.inf, "rotation rate: sample 6"),
        (2, 0.0, "acceleration: sample 6"),
        (3, np.nan, "magnetic field: sample 6"),
    ],
)
def test_what_cannot_be_fused_is_named(column: int, value: float, words: str) -> None:
    sensors = at_rest(Rotation.identity())
    sensors[column][5] = value
    with pytest.raises(ScanError, match=words):
        frames_from_imu(*sensors)


@pytest.mark.parametrize("slower", [60.0, 0.0])
def test_a_gyroscope_that_is_hardly_read_is_refused(slower: float) -> None:
    time, *signals = at_rest(Rotation.identity())
    with pytest.raises(ScanError, match="at least 5 samples a second"):
        frames_from_imu(60 * time if slower else 0 * time, *signals)


@pytest.mark.parametrize("count", [2, 3, 7])
def test_a_few_samples_are_enough(count: int) -> None:
    pose = Rotation.from_euler("zx", [40, 20], degrees=True)
    assert degrees_off(frames_from_imu(*at_rest(pose, count)), pose).max() < 0.1
