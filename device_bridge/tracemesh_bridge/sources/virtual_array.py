"""A virtual array: a program that prints what the sensors of a bending ribbon, comb or lattice measure."""

import signal
import sys
import time
from dataclasses import dataclass

import numpy as np

from tracemesh.geometry.rotations import matrix_to_quaternion
from tracemesh.geometry.sensing.orientation import ReferenceField
from tracemesh.geometry.sensor_array import SensorCurve
from tracemesh.geometry.simulated.moving_arrays import ARRAYS, NOISE, MovingArray
from tracemesh.wire.arrays import ArrayCurve, ArrayReading, SensorArray
from tracemesh.wire.device import Reference


@dataclass(frozen=True)
class VirtualArraySettings:
    """rate: readings per second. noise: factor on that of a good sensor. readings: how many, or None for no end."""

    shape: str = "ribbon"
    rate: float = 30.0
    noise: float = 1.0
    seed: int = 0
    readings: int | None = None


def run_virtual_array(settings: VirtualArraySettings) -> None:
    """Print readings at their rate until there are enough, or nobody reads them any more."""
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    moving, generator = ARRAYS[settings.shape](), np.random.default_rng(settings.seed)
    began, number = time.monotonic(), 0
    while settings.readings is None or number < settings.readings:
        time.sleep(max(0.0, began + number / settings.rate - time.monotonic()))
        reading = measure(moving, number / settings.rate, settings.noise * NOISE, generator)
        line = reading.model_dump_json(include={"time", "acceleration", "magnetic"})
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
        number += 1


def declare(moving: MovingArray) -> SensorArray:
    """What a hello says of the array."""
    return SensorArray(curves=[_curve(curve) for curve in moving.array.curves])


def measure(moving: MovingArray, at: float, noise: float, generator: np.random.Generator) -> ArrayReading:
    """What all sensors measure at a time, s; noise: of a unit vector, per axis."""
    known = Reference()
    field = ReferenceField(known.acceleration, known.magnetic)
    acceleration, magnetic = moving.vectors(at, field, noise, generator)
    rows = {"acceleration": acceleration.round(6).tolist(), "magnetic": magnetic.round(6).tolist()}
    return ArrayReading.model_validate({"seq": 0, "time": at, **rows})


def _curve(curve: SensorCurve) -> ArrayCurve:
    return ArrayCurve.model_validate(
        {
            "sensors": curve.sensors.tolist(),
            "spacing": curve.spacing.tolist(),
            "boundary": curve.boundary,
            "closed": curve.closed,
            "mounting": matrix_to_quaternion(curve.mounting[:1]).tolist(),
        }
    )
