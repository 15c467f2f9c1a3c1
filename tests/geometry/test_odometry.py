"""Distance from ticks and from time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracemesh.errors import ScanError
from tracemesh.geometry.sensing.odometry import NOMINAL_SPEED, distance_from_ticks, distance_from_time


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
