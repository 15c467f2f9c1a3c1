"""Calibrations: made of readings, read from files, applied to what a device sent."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from pydantic import ValidationError

from tracemesh.errors import InputError
from tracemesh.geometry.rotations import matrix_to_quaternion, normalized, quaternion_to_matrix
from tracemesh.geometry.scan import Floats
from tracemesh.geometry.sensing.calibration import fit_calibration, wheel_circumference
from tracemesh.geometry.sensing.calibration_ellipsoid import Correction, SensorFit
from tracemesh.wire.calibration import Calibration, CalibrationReadings, SensorCorrection, StraightRun
from tracemesh.wire.device import Device

_READY = ({"tangent", "normal"}, {"quaternion"})
"""Columns that are orientations already: no sensor's correction changes them."""


@dataclass(frozen=True)
class Calibrated:
    """A curve's columns and its device with a calibration applied; label: its name, empty if it made no difference."""

    columns: dict[str, Floats]
    device: Device
    label: str


def read_calibration(text: str, source: str = "") -> Calibration:
    """Calibration in JSON, as `tracemesh-bridge calibrate` writes it; raises InputError with `source` and field."""
    try:
        return Calibration.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ": ".join(filter(None, (source, ".".join(map(str, first["loc"])))))
        raise InputError(f"{where}: wanted a calibration: {first['msg'].removeprefix('Value error, ')}") from None


def write_calibration(calibration: Calibration) -> str:
    """Text of which `read_calibration` makes the same calibration."""
    return calibration.model_dump_json(indent=1, exclude_none=True) + "\n"


def calibration_from_readings(device: str, readings: CalibrationReadings) -> Calibration:
    """The calibration of a device from its own readings; raises ScanError where they do not tell enough."""
    found: dict[str, object] = _sensors(readings) if readings.acceleration else {}
    return Calibration.model_validate(
        {
            "device": device,
            "made": readings.made or datetime.now(UTC),
            "place": readings.place,
            "circumference": _circumference(readings.run) if readings.run else None,
            "source": readings.source,
            **found,
        }
    )


def _sensors(readings: CalibrationReadings) -> dict[str, object]:
    faces = np.array(readings.faces, float) if readings.faces else None
    fit = fit_calibration(np.array(readings.acceleration, float), np.array(readings.magnetic, float), faces)
    return {
        "accelerometer": _in_message(fit.accelerometer),
        "magnetometer": _in_message(fit.magnetometer),
        "alignment": tuple(matrix_to_quaternion(fit.alignment).tolist()),
        "dip": fit.dip,
        "dip_spread_before": fit.dip_spread_before,
        "dip_spread_after": fit.dip_spread_after,
    }


def _circumference(run: StraightRun) -> float:
    return wheel_circumference(np.array(run.ticks, np.int64), run.length, run.ticks_per_turn)


def _in_message(fit: SensorFit) -> SensorCorrection:
    return SensorCorrection.model_validate(
        {
            "matrix": fit.correction.matrix.tolist(),
            "offset": fit.correction.offset.tolist(),
            "coverage": fit.coverage.fraction,
            "spread_before": fit.spread_before,
            "spread_after": fit.spread_after,
        }
    )


def corrections(device: Device) -> dict[str, Correction]:
    """What makes `acceleration` and `magnetic` right, by name; the second one is turned into the first one's axes."""
    calibration = device.calibration
    if calibration is None or calibration.accelerometer is None or calibration.magnetometer is None:
        return {}
    turn = quaternion_to_matrix(normalized(np.array(calibration.alignment)))
    up, field = (_correction(c) for c in (calibration.accelerometer, calibration.magnetometer))
    return {"acceleration": up, "magnetic": Correction(turn @ field.matrix, field.offset)}


def _correction(message: SensorCorrection) -> Correction:
    return Correction(np.array(message.matrix, float), np.array(message.offset, float))


def calibrate(columns: dict[str, Floats], device: Device) -> Calibrated:
    """What a device would have sent with right sensors and the right wheel, by its calibration; without one as sent."""
    if device.calibration is None:
        return Calibrated(columns, device, "")
    found = corrections(device)
    right = {name: found[name](column) if name in found else column for name, column in columns.items()}
    turned = bool(found.keys() & columns.keys()) and not any(ready <= columns.keys() for ready in _READY)
    rolled = device.calibration.circumference is not None and "ticks" in columns and "distance" not in columns
    return Calibrated(right, with_right_wheel(device), device.calibration.label if turned or rolled else "")


def with_right_wheel(device: Device) -> Device:
    """The device with the wheel that its calibration measured, if it did and the device has one."""
    if device.wheel is None or device.calibration is None or device.calibration.circumference is None:
        return device
    wheel = device.wheel.model_copy(update={"circumference": device.calibration.circumference})
    return device.model_copy(update={"wheel": wheel})
