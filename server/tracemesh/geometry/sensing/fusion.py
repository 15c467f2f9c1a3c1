"""Orientations from gyroscope, accelerometer and magnetometer together, as a phone has them: VQF in its offline form.

Laidig and Seel, "VQF: Highly Accurate IMU Orientation Estimation with Bias Estimation and Magnetic Disturbance
Rejection", Information Fusion 91 (2023).
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from vqf import offlineVQF

from tracemesh.errors import ScanError
from tracemesh.geometry.rotations import align_signs
from tracemesh.geometry.sensing.orientation import Floats, frames_from_quaternions

GRAVITY = 9.80665
"""m/s²; VQF tells rest from motion by it."""
_SILENCE = 10.0
"""Median sampling times; how the device turned in a longer silence nobody knows: it is fused anew after it."""
_FLUENT = 5.0
"""Hz; a gyroscope read more slowly says nothing of the turning between its samples."""


def frames_from_imu(
    time: Floats, rotation_rate: Floats, acceleration: Floats, magnetic: Floats, mounting: Floats | None = None
) -> Floats:
    """Frames [t N B] (n, 3, 3), world (y to magnetic North), of a device moved at will.

    time: (n,) s, never decreasing, need not be even. rotation_rate: (n, 3) rad/s. acceleration: (n, 3), up at rest, any
    unit. magnetic: (n, 3), any unit; all in the device's axes. mounting: (3, 3) maps (t, N, B) coordinates to them.
    Raises ScanError where a number is not finite, the clock runs backwards, or samples are fewer than five a second.
    """
    columns = {"rotation rate": rotation_rate, "acceleration": acceleration, "magnetic field": magnetic}
    _check(time, columns)
    period = float(np.median(np.diff(np.unique(time)))) if time[-1] > time[0] else np.inf
    if period > 1 / _FLUENT:
        raise ScanError(f"wanted at least {_FLUENT:g} samples a second to fuse with a gyroscope, got {1 / period:.2g}")
    strength = np.median(np.linalg.norm(acceleration, axis=1))
    signals = np.hstack([rotation_rate, acceleration * (GRAVITY / strength), magnetic])
    quaternion = np.empty((len(time), 4))
    for part in _stretches(time, _SILENCE * period):
        quaternion[part] = _fused(time[part], signals[part], period)
    return frames_from_quaternions(quaternion, mounting)


def _check(time: Floats, columns: dict[str, Floats]) -> None:
    for name, values in columns.items():
        if values.shape != (len(time), 3):
            raise ScanError(f"{name}: wanted an array ({len(time)}, 3), got one of shape {values.shape}")
        size = np.abs(values).max(axis=1)
        good = (size < 1e150) & ((size > 1e-150) | (name == "rotation rate"))
        if not good.all():
            raise ScanError(f"{name}: sample {int((~good).argmax()) + 1} is not finite, or zero")
    backwards = np.flatnonzero(~(np.diff(time) >= 0))
    if len(backwards):
        raise ScanError(f"the device's clock runs backwards after sample {backwards[0] + 1}")


def _stretches(time: Floats, silence: float) -> Iterator[slice]:
    """Runs of samples without a pause longer than `silence` s."""
    ends = [0, *(np.flatnonzero(np.diff(time) > silence) + 1).tolist(), len(time)]
    return (slice(first, last) for first, last in pairwise(ends))


def _fused(time: Floats, signals: Floats, period: float) -> Floats:
    """Quaternions (n, 4), device -> world, at times (n,) s; VQF itself wants even ones, about `period` s apart."""
    steps = max(round(float(time[-1] - time[0]) / period), 1)
    even = time[0] + np.arange(steps + 1) * max(float(time[-1] - time[0]) / steps, period / steps)
    resampled = np.column_stack([np.interp(even, time, column) for column in signals.T])
    gyr, acc, mag = (np.ascontiguousarray(resampled[:, i : i + 3]) for i in (0, 3, 6))
    found = align_signs(offlineVQF(gyr, acc, mag, float(even[1] - even[0]))["quat9D"])
    return np.column_stack([np.interp(time, even, column) for column in found.T])
