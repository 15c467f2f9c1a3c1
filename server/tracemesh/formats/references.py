"""Recordings, the field that their vectors are compared with, and the calibration that corrects them first."""

from dataclasses import replace

import numpy as np

from tracemesh.errors import InputError
from tracemesh.formats.calibrations import calibrate
from tracemesh.formats.recordings import Recording
from tracemesh.geometry.sensing.magnetic_field import field_at_rest
from tracemesh.geometry.sensing.orientation import ReferenceField
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.calibration import Calibration
from tracemesh.wire.device import Recorded, Reference, Samples


def with_reference(recording: Recording, field: ReferenceField) -> Recording:
    """The recording as if made in this field; raises InputError where that makes no difference to any curve."""
    if not any(_needs_reference(m) for m in recording.messages):
        raise InputError(
            f"recording {recording.hello.recording}: its orientations do not depend on the magnetic field of a place: "
            "wanted acceleration and magnetic without rotation_rate"
        )
    reference = Reference(acceleration=field.acceleration, magnetic=field.magnetic)
    device = recording.hello.device.model_copy(update={"reference": reference})
    return replace(recording, hello=recording.hello.model_copy(update={"device": device}))


def with_calibration(recording: Recording, calibration: Calibration | None) -> Recording:
    """The recording with this calibration of its device; None leaves the one that it has.

    Raises InputError where it is another device's.
    """
    if calibration is None:
        return recording
    device = recording.hello.device
    if calibration.device != device.id:
        raise InputError(f"wanted a calibration of the device {device.id}, got one of {calibration.device}")
    right = device.model_copy(update={"calibration": calibration})
    return replace(recording, hello=recording.hello.model_copy(update={"device": right}))


def measured_reference(recording: Recording) -> ReferenceField:
    """The field by a device at rest; raises InputError where its recording has no vectors, ScanError if it moved."""
    blocks = [m for m in recording.messages if isinstance(m, Samples) and m.acceleration and m.magnetic]
    if not blocks:
        raise InputError(f"recording {recording.hello.recording}: wanted samples with acceleration and magnetic")
    columns = {
        name: np.concatenate([np.array(getattr(block, name), float) for block in blocks])
        for name in ("acceleration", "magnetic")
    }
    right = calibrate(columns, recording.hello.device).columns
    return field_at_rest(right["acceleration"], right["magnetic"])


def _needs_reference(message: Recorded) -> bool:
    if isinstance(message, ArrayReading):
        return message.quaternion is None
    if not isinstance(message, Samples):
        return False
    others = (message.quaternion, message.tangent and message.normal, message.rotation_rate and message.time)
    return all(other is None for other in others)
