"""A virtual device whose sensors and wheel err in just the way that a calibration corrects."""

from pathlib import Path

import numpy as np

from tracemesh.formats.calibrations import corrections, read_calibration
from tracemesh.geometry.sensing.calibration_ellipsoid import Correction
from tracemesh.geometry.simulated.simulation import TICKS_PER_TURN, WHEEL_CIRCUMFERENCE
from tracemesh.wire.base import Vector
from tracemesh.wire.calibration import Calibration
from tracemesh.wire.device import Device
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.framing import Frame

LARGEST = 32767 / 32768
"""What a sensor shows at the end of its range."""


class Distortion:
    """From the frame of a perfect device to that of one which needs a calibration."""

    def __init__(self, calibration: Calibration) -> None:
        """`calibration`: what would correct it."""
        device = Device(id=calibration.device, kind="virtual", calibration=calibration)
        self._corrections = corrections(device)
        self._wheel = WHEEL_CIRCUMFERENCE / (calibration.circumference or WHEEL_CIRCUMFERENCE)

    def __call__(self, frame: Frame) -> Frame:
        """What this device says instead."""
        ticks = int(self._wheel * (frame.ticks[0] * TICKS_PER_TURN + frame.ticks[1]) + 1e-6)
        acceleration, magnetic = (
            _undone(self._corrections.get(name), getattr(frame, name)) for name in ("acceleration", "magnetic")
        )
        return Frame(divmod(ticks, TICKS_PER_TURN), acceleration, magnetic)


def read_file(path: Path) -> Calibration:
    """The calibration in a file. Raises BridgeError if there is no such file, InputError if it is none."""
    try:
        return read_calibration(path.read_text(), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise BridgeError(f"cannot read {path}: {error}") from error


def _undone(correction: Correction | None, vector: Vector) -> Vector:
    if correction is None:
        return vector
    wrong = np.linalg.solve(correction.matrix, np.array(vector)) + correction.offset
    x, y, z = (float(c) for c in np.clip(wrong, -LARGEST, LARGEST))
    return (x, y, z)
