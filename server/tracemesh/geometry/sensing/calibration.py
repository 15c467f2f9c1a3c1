"""Calibration of a device: what its sensors really measured, how they are turned, how long one turn of its wheel is.

The model is Li and Griffiths', v = S (m - h), "Least squares ellipsoid specific fitting", Geometric Modeling and
Processing (2004), solved on lengths rather than on their squares, because those are what the noise is on.
"""

from dataclasses import dataclass

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.rotations import normalized
from tracemesh.geometry.scan import Floats, Ints
from tracemesh.geometry.sensing.calibration_alignment import alignment, face_rotation
from tracemesh.geometry.sensing.calibration_ellipsoid import LARGEST, Correction, SensorFit, fit_sensor
from tracemesh.geometry.sensing.odometry import distance_from_ticks
from tracemesh.geometry.sensing.orientation import angles_between

SHORTEST_RUN = 1e-3
"""m; a shorter one was not measured with a ruler."""
LEAST_TURNS = 3.0
"""Of the wheel, in a straight run; its ends are known to about a tick and the ruler's length to about 1 mm."""
MOST_BACK = 0.02
"""Part of a straight run by which the wheel may have gone back."""


@dataclass(frozen=True)
class CalibrationFit:
    """Both sensors of a device, and how they are turned.

    alignment: (3, 3) turns the magnetometer's corrected vectors into the accelerometer's axes. dip: rad, of the field
    below the horizontal. dip_spread_before, dip_spread_after: rad, robust standard deviations over all poses.
    """

    accelerometer: SensorFit
    magnetometer: SensorFit
    alignment: Floats
    dip: float
    dip_spread_before: float
    dip_spread_after: float


def fit_calibration(acceleration: Floats, magnetic: Floats, faces: Floats | None = None) -> CalibrationFit:
    """The calibration of a device that was turned slowly through all directions.

    acceleration: (n, 3), up at rest. magnetic: (n, 3); both in the device's own unit. faces: (k, 3) raw accelerations
    of the device at rest on its faces, one each; without them the accelerometer's axes are taken for those of the case.
    Raises ScanError where directions are missing, and says which, or where the vectors contradict one another.
    """
    if acceleration.shape != magnetic.shape:
        raise ScanError(f"wanted as many magnetic as acceleration vectors, got {len(magnetic)} and {len(acceleration)}")
    up, field = fit_sensor(acceleration, "accelerometer"), fit_sensor(magnetic, "magnetometer")
    both = up.used & field.used
    a, m = up.correction(acceleration[both]), field.correction(magnetic[both])
    turn = alignment(a, m)
    after = angles_between(a, m @ turn.T)
    before = angles_between(acceleration[both], magnetic[both])
    if faces is not None:
        case = face_rotation(_directions(up.correction(faces)))
        up = SensorFit(
            Correction(case @ up.correction.matrix, up.correction.offset),
            up.coverage, up.spread_before, up.spread_after, up.used,
        )  # fmt: skip
        turn = case @ turn
    dip = float(np.median(after)) - np.pi / 2
    return CalibrationFit(up, field, turn, dip, _robust_deviation(before), _robust_deviation(after))


def _directions(faces: Floats) -> Floats:
    """Unit vectors (k, 3)."""
    size = np.abs(faces).max(axis=1, initial=0.0)
    bad = ~((size > 1e-9) & (size < LARGEST))
    if bad.any():
        raise ScanError(
            f"the acceleration on face {int(bad.argmax()) + 1} is zero, not finite or larger than {LARGEST:g}"
        )
    return normalized(faces)


def _robust_deviation(values: Floats) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def wheel_circumference(ticks: Ints, length: float, ticks_per_turn: int) -> float:
    """m that one turn of the wheel travels, from one straight run of a length (m) that a ruler measured.

    ticks: (n, 2) turns and parts of a turn, from the run's first to its last. Raises ScanError where the wheel turned
    less than LEAST_TURNS times, or went back.
    """
    if not (np.isfinite(length) and length >= SHORTEST_RUN):
        raise ScanError(f"wanted the length of the run in metres, at least {SHORTEST_RUN:g}, got {length:g}")
    turns = distance_from_ticks(ticks, 1.0, ticks_per_turn) if len(ticks) else np.zeros(1)
    turned = float(abs(turns[-1] - turns[0]))
    if turned < LEAST_TURNS:
        raise ScanError(f"wanted a run of at least {LEAST_TURNS:g} turns of the wheel, got {turned:.2f}")
    way = float(np.abs(np.diff(turns)).sum())
    if way - turned > 2 * MOST_BACK * turned:
        raise ScanError(
            f"wanted a straight run in one direction, but the wheel went back by {(way - turned) / 2:.2f} of its "
            f"{turned:.2f} turns"
        )
    return length / turned
