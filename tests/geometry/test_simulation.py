"""The simulated device: its odometer and vectors are those of the true curve, its faults have the sizes asked for."""

from dataclasses import replace

import numpy as np
import pytest

from tracemesh.geometry.simulated.shapes import SHAPES, leaf
from tracemesh.geometry.simulated.simulation import (
    COUNTS,
    FULL_SCALE,
    REFERENCE_ACCELERATION,
    REFERENCE_MAGNETIC,
    TICKS_PER_TURN,
    WHEEL_CIRCUMFERENCE,
    Handling,
    Imperfections,
    Readings,
    exact_scan,
    plan_scan,
    simulate_scan,
)

PERFECT = Imperfections().scaled(0.0)


def distance(readings: Readings) -> np.ndarray:
    return readings.ticks @ [1, 1 / TICKS_PER_TURN] * WHEEL_CIRCUMFERENCE


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_a_perfect_device_measures_the_exact_curve(name: str) -> None:
    plan = plan_scan(SHAPES[name](), imperfections=PERFECT)
    for curve, true in zip(simulate_scan(plan), plan.curves, strict=True):
        travelled = distance(curve.readings) - distance(curve.readings)[0]
        tick = WHEEL_CIRCUMFERENCE / TICKS_PER_TURN
        np.testing.assert_allclose(travelled[curve.node_samples], true.node_positions, atol=1.01 * tick)
        frames = true.at(travelled)[1]
        for counts, reference in (
            (curve.readings.acceleration, REFERENCE_ACCELERATION),
            (curve.readings.magnetic, REFERENCE_MAGNETIC),
        ):
            np.testing.assert_allclose(counts * (FULL_SCALE / COUNTS), reference @ frames, atol=0.01)
        assert curve.node_ids.tolist() == true.node_ids.tolist()


def test_the_motion_is_smooth_pauses_at_nodes_and_keeps_its_speed() -> None:
    handling = Handling(speed=0.1, acceleration=0.2, pause=0.8)
    plan = plan_scan(leaf(), handling, PERFECT)
    time = np.linspace(0, plan.duration, 20001)
    travelled = distance(plan.readings(time, np.random.default_rng(0)))
    speed = np.gradient(travelled, time)
    assert (np.diff(travelled) >= 0).all()
    assert np.quantile(speed, 0.99) == pytest.approx(0.1, rel=0.15)
    assert travelled[-1] == pytest.approx(sum(c.length for c in plan.curves), abs=0.001)
    for key in plan.keys:
        if key.key == "node":
            near = abs(time - key.time) < 0.39
            assert np.ptp(travelled[near]) == 0


def test_the_keys_tell_the_story_of_the_session() -> None:
    plan = plan_scan(leaf())
    assert [k.time for k in plan.keys] == sorted(k.time for k in plan.keys)
    story = [k.key for k in plan.keys]
    assert story[0] == "boundary"
    assert story.count("interior") == len(plan.curves) - 1
    assert story.count("end") == len(plan.curves)
    assert [k.node for k in plan.keys if k.key == "node"] == [n for c in plan.curves for n in c.node_ids.tolist()]


def test_noise_marks_and_outliers_have_the_sizes_asked_for() -> None:
    wanted = Imperfections(vector=0.02, outliers=0.05, heading=0.0, mark=0.003)
    noisy, clean = (
        plan_scan(leaf(), imperfections=i, seed=3) for i in (wanted, replace(wanted, vector=0.0, outliers=0.0))
    )
    time = np.linspace(2, noisy.duration, 20000)
    a, b = (p.readings(time, np.random.default_rng(5)) for p in (noisy, clean))
    error = (a.acceleration - b.acceleration) * (FULL_SCALE / COUNTS)
    ordinary = np.linalg.norm(error, axis=1) < 0.12
    assert 1 - ordinary.mean() == pytest.approx(0.05, rel=0.15)
    assert error[ordinary].std() == pytest.approx(0.02, rel=0.03)
    stops = [k for k in noisy.keys if k.key == "node"]
    offsets = []
    for stop in stops:
        curve, _, position = noisy._state(np.array([stop.time]))
        true = noisy.curves[int(curve[0])].node_positions
        offsets.append(np.abs(true - position[0]).min())
    assert np.sqrt(np.mean(np.square(offsets))) == pytest.approx(0.003, rel=0.4)


def test_a_heading_error_turns_the_field_about_the_vertical_only() -> None:
    plan = plan_scan(leaf(), imperfections=replace(PERFECT, heading=0.05), seed=2)
    true = plan_scan(leaf(), imperfections=PERFECT, seed=2)
    time = np.linspace(2, plan.duration, 2000)
    turned, straight = (p.readings(time, np.random.default_rng(0)) for p in (plan, true))
    assert turned.acceleration.tolist() == straight.acceleration.tolist()
    between = np.einsum("ij,ij->i", turned.magnetic, straight.magnetic) / np.sum(straight.magnetic**2.0, axis=1)
    curve = plan._state(time)[0]
    # two directions at the dip of the field, a heading apart
    horizontal = REFERENCE_MAGNETIC[0] ** 2
    wanted = 1 - horizontal * (1 - np.cos(plan.heading[curve]))
    np.testing.assert_allclose(between, wanted, atol=2e-4)


def test_the_same_seed_gives_the_same_scan_and_another_gives_another() -> None:
    one, two, other = (simulate_scan(plan_scan(leaf(), seed=s), seed=s) for s in (1, 1, 2))
    assert one[0].readings.magnetic.tolist() == two[0].readings.magnetic.tolist()
    assert one[0].readings.magnetic.tolist() != other[0].readings.magnetic[: len(one[0].time)].tolist()


def test_the_turn_counter_wraps_like_a_signed_16_bit_number() -> None:
    plan = plan_scan(leaf(), imperfections=PERFECT)
    far = replace(plan, travelled=plan.travelled + 32767 * WHEEL_CIRCUMFERENCE)
    turns = far.readings(np.array([0.0, plan.duration]), np.random.default_rng(0)).ticks[:, 0]
    assert turns[0] == 32767
    assert turns[1] == 32767 + int(plan.travelled[-1] / WHEEL_CIRCUMFERENCE) - 65536


def test_an_exact_scan_has_nodes_as_samples() -> None:
    shape = leaf()
    for curve, true in zip(exact_scan(shape, 0.01).curves, shape.curves, strict=True):
        np.testing.assert_allclose(curve.distance[curve.node_samples], true.node_positions, atol=1e-14)
        frames = true.at(curve.distance)[1]
        assert curve.tangent.tolist() == frames[:, :, 0].tolist()
        assert np.abs(np.diff(curve.distance) - 0.01).max() < 0.003
