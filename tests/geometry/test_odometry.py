"""Distance from ticks and from time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracemesh.errors import ScanError
from tracemesh.geometry.sensing.odometry import NOMINAL_SPEED, distance_from_ticks, distance_from_time, felt_pauses

Floats = NDArray[np.float64]


@settings(max_examples=50, deadline=None)
@given(st.integers(-32768, 32767), st.lists(st.integers(-2000, 2000), min_size=1, max_size=30))
def test_a_wrapping_counter_is_unwound(start: int, steps: list[int]) -> None:
    total = start * 500 + np.cumsum([0, *steps])
    wrapped = (total // 500 + 2**15) % 2**16 - 2**15
    distance = distance_from_ticks(np.column_stack([wrapped, total % 500]), 0.1, 500)
    np.testing.assert_allclose(distance, (total - total[0]) * 0.0002, atol=1e-12)


def test_constant_speed_without_pauses() -> None:
    time = np.linspace(5.0, 7.0, 101)
    frames = Rotation.from_rotvec(np.linspace([0, 0, 0], [0, 0, 3], 101)).as_matrix()
    distance = distance_from_time(time, frames, np.array([0, 100]))
    assert distance[-1] == pytest.approx(2 * NOMINAL_SPEED, rel=0.05)
    assert np.ptp(np.diff(distance)[3:-3]) < 1e-12


def test_a_pause_at_a_node_is_no_way() -> None:
    angle = np.concatenate([np.linspace(0, 1, 101), np.full(50, 1.0), np.linspace(1, 2, 101)])
    time = np.arange(len(angle)) * 0.02
    frames = Rotation.from_rotvec(np.outer(angle, [0, 1, 0])).as_matrix()
    distance = distance_from_time(time, frames, np.array([0, 125, len(angle) - 1]))
    assert distance[-1] == pytest.approx(4.0 * NOMINAL_SPEED, rel=0.06)
    assert np.ptp(distance[102:150]) == 0


def test_a_straight_line_is_not_taken_for_a_pause() -> None:
    frames = np.broadcast_to(np.eye(3), (101, 3, 3))
    distance = distance_from_time(np.linspace(0, 2, 101), frames, np.array([0, 100]))
    assert distance[-1] > 0.15 * 2 * NOMINAL_SPEED
    assert (np.diff(distance) >= 0).all()


def test_a_clock_that_runs_backwards_is_refused() -> None:
    with pytest.raises(ScanError, match="backwards after sample 2"):
        distance_from_time(np.array([0.0, 1.0, 0.5]), np.broadcast_to(np.eye(3), (3, 3, 3)), np.array([], np.int64))


def led_by_hand(speed: Floats, bent: float, shaken: float, seed: int = 1) -> tuple[Floats, Floats, Floats]:
    """Time, frames and accelerations of a phone that a hand leads at these speeds along an arc, 100 times a second."""
    random = np.random.default_rng(seed)
    angle = bent * np.cumsum(speed) / 100
    turns = Rotation.from_rotvec(np.outer(angle, [1.0, 0.0, 0.0]))
    shake = (0.02 + shaken * (speed > 0))[:, None] * random.standard_normal((len(speed), 3))
    trembling = Rotation.from_rotvec(0.001 * random.standard_normal((len(speed), 3)))
    return np.arange(len(speed)) / 100, (turns * trembling).as_matrix(), turns.inv().apply([0.0, 0.0, 9.81]) + shake


def speeds(*stretches: tuple[float, float]) -> Floats:
    """m/s, from pairs of seconds and speed."""
    return np.concatenate([np.full(round(100 * seconds), speed) for seconds, speed in stretches])


@pytest.mark.parametrize("bent", [0.0, 3.0])
@pytest.mark.parametrize("pause", [0.6, 2.0])
def test_standing_still_between_nodes_adds_no_distance(bent: float, pause: float) -> None:
    time, frames, acceleration = led_by_hand(speeds((0.5, 0), (3, 0.1), (pause, 0), (4, 0.1), (0.5, 0)), bent, 0.3)
    distance = distance_from_time(time, frames, np.array([0, len(time) - 1]), acceleration)
    before, after = (np.ptp(distance[a:b]) for a, b in ((0, 355), (345 + round(100 * pause), len(time))))
    assert np.ptp(distance[365 : 335 + round(100 * pause)]) == 0
    assert before / after == pytest.approx(3 / 4, rel=0.08)


@pytest.mark.parametrize("shaken", [0.0, 0.02, 0.3])
def test_moving_on_is_no_pause_however_straight(shaken: float) -> None:
    time, frames, acceleration = led_by_hand(speeds((6, 0.1)), 0.0, shaken)
    assert felt_pauses(time, frames, acceleration) is None


def test_turning_on_the_spot_of_a_device_that_is_not_shaken_is_no_pause() -> None:
    time, frames, acceleration = led_by_hand(speeds((3, 0.1), (2, 0), (3, 0.1)), 0.0, 0.3)
    frames[300:500] = frames[300:500] @ Rotation.from_rotvec(np.outer(np.linspace(0, 1, 200), [0, 1, 0])).as_matrix()
    still = felt_pauses(time, frames, acceleration)
    assert still is not None
    assert not still[320:480].any()


def test_without_noise_or_with_few_samples_nothing_is_a_pause() -> None:
    time, frames, acceleration = led_by_hand(speeds((3, 0.1), (2, 0), (3, 0.1)), 0.0, 0.3)
    assert felt_pauses(time, frames, np.tile([0.0, 0.0, 9.81], (len(time), 1))) is None
    assert felt_pauses(time[:50], frames[:50], acceleration[:50]) is None
    assert felt_pauses(time[::20], frames[::20], acceleration[::20]) is None
    assert felt_pauses(np.zeros(len(time)), frames, acceleration) is None
