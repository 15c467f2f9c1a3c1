"""A calibration undoes what a device's sensors do wrong, later too; what it cannot be applied to is said."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from tracemesh.errors import InputError, ScanError
from tracemesh.formats.calibrations import calibration_from_readings, corrections, read_calibration, write_calibration
from tracemesh.formats.recordings import Recording, recording_from_simulation, scan_from_recordings, write_recording
from tracemesh.formats.references import with_calibration
from tracemesh.formats.scans import read_scan
from tracemesh.geometry.sensing.orientation import angles_between
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import Imperfections, plan_scan, simulate_scan
from tracemesh.pipeline import reconstruct
from tracemesh.wire.calibration import Calibration, CalibrationReadings, StraightRun
from tracemesh.wire.device import Device, Samples
from tracemesh.wire.resources import ReconstructionParameters

Floats = NDArray[np.float64]
IRON = np.array([[1.2, 0.1, 0.0], [0.1, 0.9, -0.05], [0.0, -0.05, 1.0]])
HARD = np.array([0.3, -0.2, 0.1])
TURN = Rotation.from_rotvec([0.05, -0.02, 0.06])
SCALES = np.diag([1.03, 0.98, 1.01])
BIAS = np.array([0.02, -0.03, 0.01])
NOW = datetime(2026, 5, 3, tzinfo=UTC)


def wrong(acceleration: Floats, magnetic: Floats) -> dict[str, list[list[float]]]:
    """What the sensors of the test's device make of the truth."""
    field = TURN.inv().apply(magnetic) @ IRON.T + HARD
    return {"acceleration": (acceleration @ SCALES + BIAS).tolist(), "magnetic": field.tolist()}


def readings(**more: object) -> CalibrationReadings:
    """The device turned through all directions, exactly; a run of 1 m in which the wheel turned 9.8 times."""
    poses = Rotation.random(500, rng=np.random.default_rng(3)).inv()
    vectors = wrong(poses.apply([0.0, 0.0, 1.0]), poses.apply([0.5, 0.0, -(0.75**0.5)]))
    run = {"ticks": [[9, 400], [19, 300]], "length": 1.0}
    return CalibrationReadings.model_validate({"made": NOW, "run": run, **vectors, **more})


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibration_from_readings("simulated", readings()).model_copy(update={"version": 3})


@pytest.fixture(scope="module")
def recordings() -> tuple[Recording, Recording]:
    """What an exact device sends of a leaf, and what the test's device sends."""
    right = recording_from_simulation(simulate_scan(plan_scan(leaf(), imperfections=Imperfections().scaled(0))), "leaf")
    messages = [
        m.model_copy(update=wrong(np.array(m.acceleration), np.array(m.magnetic))) if isinstance(m, Samples) else m
        for m in right.messages
    ]
    return right, Recording(right.hello, messages)


def test_an_old_recording_gets_its_true_orientations_by_a_later_calibration(
    calibration: Calibration, recordings: tuple[Recording, Recording]
) -> None:
    truth, raw = (scan_from_recordings([r]) for r in recordings)
    later = scan_from_recordings([with_calibration(recordings[1], calibration)])
    for true, measured, corrected in zip(truth.curves, raw.curves, later.curves, strict=True):
        assert np.degrees(angles_between(true.normal, measured.normal)).max() > 3
        assert np.degrees(angles_between(true.normal, corrected.normal)).max() < 0.05
        np.testing.assert_allclose(corrected.distance, true.distance * 1.0 / (9.8 * 0.1), atol=1e-12)
        assert (measured.calibration, corrected.calibration) == ("", "calibration 3 of simulated, 2026-05-03")


def test_the_report_says_what_was_used(calibration: Calibration, recordings: tuple[Recording, Recording]) -> None:
    parameters = ReconstructionParameters(step="6%", surface=False)
    both = [recordings[0], with_calibration(recordings[1], calibration)]
    scan = scan_from_recordings(both)
    half = len(scan.curves) // 2
    report = reconstruct(scan, parameters).report
    used = {"calibration": "calibration 3 of simulated, 2026-05-03", "curves": [*range(half, 2 * half)]}
    assert report["calibrations"] == [used]
    assert reconstruct(scan_from_recordings(recordings[:1]), parameters).report["calibrations"] == []


def test_reading_undoes_writing(calibration: Calibration) -> None:
    assert read_calibration(write_calibration(calibration)) == calibration


@given(text=st.text() | st.dictionaries(st.text(max_size=5), st.integers()).map(repr))
@settings(max_examples=30)
def test_what_is_no_calibration_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"cal\.json"):
        read_calibration(text, "cal.json")


def test_readings_that_tell_too_little_are_refused() -> None:
    some = readings()
    cap = [i for i, a in enumerate(some.acceleration) if a[2] > 0.2]
    half = some.model_copy(
        update={name: [getattr(some, name)[i] for i in cap] for name in ("acceleration", "magnetic")}
    )
    with pytest.raises(ScanError, match=r"accelerometer: wanted readings with at least 70%.*-z"):
        calibration_from_readings("d", half)
    with pytest.raises(ScanError, match="at least 3 turns"):
        calibration_from_readings("d", CalibrationReadings(run=StraightRun(ticks=[(0, 0), (1, 0)], length=0.1)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"acceleration": []}, "as many magnetic vectors as accelerations"),
        ({"acceleration": [], "magnetic": [], "run": None}, "got neither"),
    ],
)
def test_readings_that_contradict_themselves_are_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        readings(**change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"accelerometer": None}, "only one of them"),
        ({"accelerometer": None, "magnetometer": None, "circumference": None}, "got neither"),
        ({"made": datetime(2026, 5, 3)}, "timezone"),
    ],
)
def test_a_calibration_is_whole(calibration: Calibration, change: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Calibration.model_validate(calibration.model_dump() | change)


def test_a_matrix_that_cannot_be_undone_is_refused(calibration: Calibration) -> None:
    assert calibration.accelerometer is not None
    flat = calibration.accelerometer.model_dump() | {"matrix": [[1, 0, 0], [0, 1, 0], [1, 1, 0]]}
    with pytest.raises(ValidationError, match="determinant of about 1, got 0"):
        Calibration.model_validate(calibration.model_dump() | {"accelerometer": flat})


def test_faces_turn_both_sensors(calibration: Calibration) -> None:
    case = Rotation.from_rotvec([0.0, 0.0, 0.1])
    faces = wrong(case.inv().apply(np.vstack([np.eye(3), -np.eye(3)])), np.ones((6, 3)))["acceleration"]
    turned = calibration_from_readings("simulated", readings(faces=faces))
    one, other = (corrections(Device(id="simulated", kind="morphorider", calibration=c)) for c in (calibration, turned))
    for name, before in one.items():
        np.testing.assert_allclose(other[name].matrix, case.as_matrix() @ before.matrix, atol=1e-7)


def test_another_devices_calibration_is_refused(
    calibration: Calibration, recordings: tuple[Recording, Recording]
) -> None:
    other = calibration.model_copy(update={"device": "other"})
    with pytest.raises(InputError, match="wanted a calibration of the device simulated, got one of other"):
        with_calibration(recordings[1], other)


def test_a_calibration_that_changes_nothing_is_refused(
    calibration: Calibration, recordings: tuple[Recording, Recording], shared_data: Path
) -> None:
    blocks = []
    for m in recordings[0].messages:
        if isinstance(m, Samples):
            ready = {"quaternion": [(1.0, 0.0, 0.0, 0.0)] * m.count, "distance": [0.01 * i for i in range(m.count)]}
            blocks.append(m.model_copy(update={"ticks": None, **ready}))
        else:
            blocks.append(m)
    with pytest.raises(InputError, match="calibration 3 of simulated, 2026-05-03 changes nothing"):
        read_scan(write_recording(Recording(recordings[0].hello, blocks)), "leaf.ndjson", calibration=calibration)
    with pytest.raises(InputError, match="wanted a recording, whose vectors a calibration can correct, got a rawnet"):
        read_scan((shared_data / "lilium.rawnet").read_text(), "lilium", calibration=calibration)
