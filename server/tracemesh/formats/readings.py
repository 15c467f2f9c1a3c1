"""Readings of fixed arrays: from what was sent to what the kernel takes."""

from collections.abc import Sequence

import numpy as np

from tracemesh.errors import InputError, ScanError
from tracemesh.formats.recordings import Recording
from tracemesh.geometry.rotations import normalized, quaternion_to_matrix
from tracemesh.geometry.scan import Floats
from tracemesh.geometry.sensing.orientation import ReferenceField, frames_from_quaternions, frames_from_vectors
from tracemesh.geometry.sensor_array import SensorArray, SensorCurve
from tracemesh.wire.arrays import ArrayCurve, ArrayReading, misfit
from tracemesh.wire.base import Quaternion
from tracemesh.wire.device import Device


def sensor_array(device: Device) -> SensorArray:
    """The topology of an array, as the kernel takes it."""
    assert device.array is not None
    own = _rotation(device.mounting)
    return SensorArray(tuple(_curve(curve, own) for curve in device.array.curves))


def reading_of(recording: Recording, number: int | None = None) -> ArrayReading:
    """A reading of an array's recording, the last one by default; raises InputError where there is none such."""
    readings = [m for m in recording.messages if isinstance(m, ArrayReading)]
    where = f"recording {recording.hello.recording}"
    if not readings:
        raise InputError(f"{where}: it holds no reading")
    if number is not None and not 0 <= number < len(readings):
        raise InputError(f"{where}: wanted a reading from 0 to {len(readings) - 1}, got {number}")
    return readings[-1 if number is None else number]


def sensor_rotations(reading: ArrayReading, device: Device) -> Floats:
    """Sensor -> world (s, 3, 3).

    Raises InputError where the reading is not one of the device's array, ScanError where a sensor's numbers have no
    direction; both name the reading.
    """
    if why := misfit(device.array, reading):
        raise InputError(f"reading {reading.seq}: {why}")
    reference = ReferenceField(device.reference.acceleration, device.reference.magnetic)
    try:
        if reading.quaternion is not None:
            return frames_from_quaternions(np.array(reading.quaternion, float))
        vectors = np.array(reading.acceleration, float), np.array(reading.magnetic, float)
        return frames_from_vectors(*vectors, reference)
    except ScanError as error:
        raise ScanError(f"reading {reading.seq}: {str(error).replace('sample', 'sensor')}") from None


def _curve(curve: ArrayCurve, device: Floats) -> SensorCurve:
    mounting = np.broadcast_to(device @ _rotation(curve.mounting), (len(curve.sensors), 3, 3))
    return SensorCurve(np.array(curve.sensors), np.array(curve.spacing), mounting, curve.boundary, curve.closed)


def _rotation(quaternion: Sequence[Quaternion] | Quaternion) -> Floats:
    return quaternion_to_matrix(normalized(np.array(quaternion)))
