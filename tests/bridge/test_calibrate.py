"""The steps of a calibration: what counts, what is told, what is refused."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracemesh.errors import ScanError
from tracemesh.geometry.simulated.calibration_ride import LENGTH, CalibrationPlan
from tracemesh.geometry.simulated.simulation import Imperfections
from tracemesh.wire.device import Device, Wheel
from tracemesh_bridge import calibration as module
from tracemesh_bridge.calibration import FACES, ROLL, TURN, Procedure, describe
from tracemesh_bridge.cli import main
from tracemesh_bridge.errors import OperatorMistake
from tracemesh_bridge.source import Reading

RIDER = Device(id="rider", kind="morphorider", wheel=Wheel())
HARD = np.array([0.9, -0.4, 0.2])


def readings(first, last, noise=1.0):
    """What a device with hard iron and bad steel sends between two times of its calibration, s."""
    raw = CalibrationPlan(Imperfections().scaled(noise)).readings(
        np.arange(first, last, 1 / 60), np.random.default_rng(1)
    )
    magnetic = raw.magnetic / 32768 @ np.diag([1.1, 0.9, 1.0]) + HARD
    for ticks, up, field in zip(
        raw.ticks.tolist(), (raw.acceleration / 32768).tolist(), magnetic.tolist(), strict=True
    ):
        yield Reading(received=0.0, ticks=tuple(ticks), acceleration=tuple(up), magnetic=tuple(field))


def led_through(procedure, noise=1.0):
    """All that the procedure says while an operator does as he is told."""
    plan, said, before = CalibrationPlan(), [], 0.0
    for enter in plan.enters:
        said += [procedure.words, *filter(None, map(procedure.take, readings(before, enter, noise)))]
        procedure.enter()
        before = enter
    return said


def test_an_operator_who_does_as_told_gets_a_calibration():
    procedure = Procedure(RIDER, LENGTH, "the lab")
    said = led_through(procedure)
    assert procedure.over
    assert [said[0], said[1]] == [TURN, FACES]
    assert [words[-15:] for words in said if "is up" in words] == [f"up: {n} of 6 faces"[-15:] for n in range(1, 7)]
    found = procedure.result()
    np.testing.assert_allclose(found.magnetometer.offset, HARD, atol=0.003)
    assert found.circumference == pytest.approx(0.1, rel=0.002)
    assert found.place == "the lab"
    assert "6 faces, a run of 1 m" in found.source
    assert "wheel: 0.1" in describe(found)[-1]


def test_however_long_it_takes_all_directions_count(monkeypatch):
    monkeypatch.setattr(module, "MAX_READINGS", 500)
    procedure = Procedure(RIDER, LENGTH)
    led_through(procedure, noise=0.0)
    found = procedure.result()
    assert int(found.source.split()[0]) < 500
    assert found.magnetometer.coverage == 1.0
    np.testing.assert_allclose(found.magnetometer.offset, HARD, atol=1e-3)
    assert found.circumference == pytest.approx(0.1, rel=0.002)


def test_the_status_counts_directions_around_the_middle_of_what_came():
    procedure = Procedure(RIDER, LENGTH)
    assert "accelerometer 0%" in procedure.status()
    for reading in readings(0.0, 40.0):
        procedure.take(reading)
    assert "accelerometer 100%, all | magnetometer 100%, all" in procedure.status()


def test_a_step_that_is_not_done_is_not_left():
    procedure = Procedure(RIDER, LENGTH)
    for reading in readings(0.0, 15.0):
        procedure.take(reading)
    with pytest.raises(OperatorMistake, match=r"accelerometer has seen \d\d% of all directions.*missing: \+x, \+y"):
        procedure.enter()
    assert procedure.words == TURN


def test_faces_and_wheel_may_be_left_out():
    procedure = Procedure(RIDER, LENGTH)
    for reading in readings(0.0, 40.0):
        procedure.take(reading)
    for _ in range(4):
        procedure.enter()
    assert procedure.over
    found = procedure.result()
    assert found.circumference is None
    assert "0 faces" in found.source
    assert describe(found)[-1] == "wheel: not measured"


def test_a_device_without_a_wheel_has_two_steps():
    procedure = Procedure(RIDER.model_copy(update={"wheel": None}), LENGTH)
    for reading in readings(0.0, 40.0):
        procedure.take(reading)
    procedure.enter()
    procedure.enter()
    assert procedure.over


def test_a_run_that_was_too_short_is_told():
    procedure = Procedure(RIDER, LENGTH)
    for reading in readings(0.0, 40.0):
        procedure.take(reading)
    for _ in range(3):
        procedure.enter()
    assert procedure.words == ROLL
    for ticks in ((0, 0), (1, 0), (2, 0)):
        procedure.take(Reading(received=0.0, ticks=ticks, acceleration=(0, 0, 1), magnetic=(1, 0, 0)))
    procedure.enter()
    with pytest.raises(ScanError, match="at least 3 turns of the wheel, got 2"):
        procedure.result()


def test_a_face_counts_once_and_only_if_it_is_one():
    procedure = Procedure(RIDER, LENGTH)
    for reading in readings(0.0, 40.0):
        procedure.take(reading)
    procedure.enter()

    def lie(up, count=120):
        vector = tuple(float(c) for c in up)
        taken = (procedure.take(Reading(received=0.0, acceleration=vector, magnetic=(1, 0, 0))) for _ in range(count))
        return [words.strip("\a ") for words in taken if words]

    assert lie([0.0, 0.0, 0.5]) == ["+z is up: 1 of 6 faces"]
    assert lie([0.01, 0.0, 0.5]) == []
    assert lie(Rotation.from_rotvec([0.6, 0, 0]).apply([0.0, 0.0, -0.5])) == []
    assert lie([-0.5, 0.02, 0.0]) == ["-x is up: 2 of 6 faces"]


def test_keys_that_end_too_early_end_the_command(bench):
    bench.virtual("--calibrating")
    command = bench.start("calibrate", "--port", str(bench.folder / "rider"), "--output", str(bench.folder / "c.json"))
    command.says("device: live")
    command.type("\n")
    command.says("wanted 70%")
    command.hang_up()
    assert command.wait() == 1
    assert "the keys ended before the calibration was complete" in command.said
    assert not (bench.folder / "c.json").exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"device": "other", "made": "2026-05-03T10:00:00Z", "circumference": 0.1}, "got one of other; see --device"),
        ({"device": "morphorider"}, "cal.json: made: wanted a calibration"),
        (None, "cannot read"),
    ],
)
def test_a_calibration_that_does_not_fit_is_refused(content, words, tmp_path, capsys):
    file = tmp_path / "cal.json"
    if content:
        file.write_text(json.dumps(content))
    assert main(["morphorider", "--port", "x", "--spool", str(tmp_path / "s"), "--calibration", str(file)]) == 1
    assert words in capsys.readouterr().err
