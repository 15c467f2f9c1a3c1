"""Dead reckoning, against a slow obvious version."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.api.live.drawing import SPACING, CurveDrawing
from tracemesh.wire.device import Device, Samples, Wheel

WHEEL = Wheel(circumference=0.1003, ticks_per_turn=500)
DEVICE = Device(id="d", kind="test", wheel=WHEEL)


def samples(ticks: np.ndarray, angles: np.ndarray, first: int) -> Samples:
    """Samples of a curve in the plane: tangents at `angles`, wheel `ticks` in parts of a turn."""
    return Samples(
        seq=0,
        curve=0,
        first_sample=first,
        ticks=[((int(t) // 500) % 2**16, int(t) % 500) for t in ticks],
        tangent=[(float(np.cos(a)), float(np.sin(a)), 0.0) for a in angles],
        normal=[(0.0, 0.0, 1.0)] * len(ticks),
    )


def reckoned(ticks: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Every sample's position, one after another."""
    position, path = np.zeros(3), [np.zeros(3)]
    for i in range(1, len(ticks)):
        step = (ticks[i] - ticks[i - 1]) * WHEEL.circumference / 500
        pair = angles[i - 1 : i + 1]
        position = position + step * np.array([np.cos(pair).mean(), np.sin(pair).mean(), 0.0])
        path.append(position)
    return np.array(path)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 40), st.floats(-0.2, 0.2)), min_size=2, max_size=60),
    st.integers(1, 7),
    st.integers(0, 500 * 2**16),
)
def test_however_it_arrives_it_is_drawn_alike(moves: list[tuple[int, float]], block: int, start: int) -> None:
    """Cut into blocks anywhere, the turn counter wrapping anywhere: the points are those of the slow version."""
    ticks = start + np.cumsum([0, *(step for step, _ in moves)])
    angles = np.cumsum([0.0, *(turn for _, turn in moves)])
    drawing = CurveDrawing(DEVICE, boundary=False)
    collected, counted = [], []
    for first in range(0, len(ticks), block):
        number, points, numbers = drawing.extend(
            [samples(ticks[first : first + block], angles[first : first + block], first)]
        )
        assert number == sum(map(len, collected))
        collected.append(points)
        counted.append(numbers)
    path = reckoned(ticks, angles)
    travelled = (ticks - ticks[0]) * WHEEL.circumference / 500
    kept = np.diff(travelled // SPACING, prepend=-1) > 0
    assert np.concatenate(collected) == pytest.approx(path[kept], abs=1e-9)
    assert drawing.positions == pytest.approx(path[kept], abs=1e-9)
    assert np.concatenate(counted).tolist() == drawing.samples.tolist() == np.flatnonzero(kept).tolist()


def test_the_rest_goes_on_where_the_solved_part_ends() -> None:
    drawing = CurveDrawing(DEVICE, boundary=False)
    drawing.extend([samples(np.arange(0, 1000, 10), np.zeros(100), 0)])
    solved = np.array([[5.0, 5, 5], [6, 5, 5]])
    drawing.settle(solved, np.array([0, 49]), last_sample=49)
    first, points, _ = drawing.extend([samples(np.arange(1000, 1100, 10), np.zeros(10), 100)])
    assert first == 2 + np.count_nonzero(drawing.positions[2:, 0] < points[0, 0])
    assert drawing.positions[:2] == pytest.approx(solved)
    assert drawing.samples[:2].tolist() == [0, 49]
    assert len(drawing.samples) == len(drawing.positions)
    assert np.all(np.diff(drawing.samples) > 0)
    assert drawing.positions[2] == pytest.approx([6, 5, 5], abs=2 * SPACING)
    assert drawing.position(49) == pytest.approx([6, 5, 5], abs=1e-9)


def test_vectors_that_tell_no_direction_go_straight_on() -> None:
    device = Device(id="d", kind="test")
    good = {"acceleration": [(0.0, 0.0, 1.0)] * 5, "magnetic": [(0.5, 0.0, -0.866)] * 5}
    dead = {"acceleration": [(0.0, 0.0, 0.0)] * 5, "magnetic": [(0.5, 0.0, -0.866)] * 5}
    drawing = CurveDrawing(device, boundary=False)
    drawing.extend([Samples(seq=0, curve=0, first_sample=0, distance=[0.0, 0.01, 0.02, 0.03, 0.04], **good)])
    direction = drawing.positions[-1] / np.linalg.norm(drawing.positions[-1])
    drawing.extend([Samples(seq=1, curve=0, first_sample=5, distance=[0.05, 0.06, 0.07, 0.08, 0.09], **dead)])
    assert drawing.positions[-1] == pytest.approx(0.09 * direction, abs=1e-9)
