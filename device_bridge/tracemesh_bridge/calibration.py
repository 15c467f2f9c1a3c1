"""The steps of a calibration: what the operator is told to do, and what is kept of the readings. No clock, no port.

Enter ends each step: turn the device through all directions, lay it on its faces, roll it along a ruler.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from tracemesh.formats.calibrations import calibration_from_readings
from tracemesh.geometry.sensing.calibration_alignment import TILTED, at_rest
from tracemesh.geometry.sensing.calibration_coverage import Coverage, coverage
from tracemesh.geometry.sensing.calibration_ellipsoid import LEAST_COVERAGE
from tracemesh.wire.base import Vector
from tracemesh.wire.calibration import MAX_READINGS, Calibration, CalibrationReadings, StraightRun
from tracemesh.wire.device import Device
from tracemesh_bridge.errors import OperatorMistake
from tracemesh_bridge.source import Reading

STILL_READINGS = 40
"""In a row, of a device that lies on a face: under a second of a Morphorider."""
LOOK_EVERY = 10
"""Readings between two looks whether it lies still."""

TURN = (
    "1 of 3  Turn the device slowly through all directions: each side up once, and round again facing each wall. Keep "
    "away from steel. Nothing is missing any more? Press Enter."
)
FACES = (
    "2 of 3  Lay it still on each of its six faces, one by one, a second or two each. Press Enter when done, or at "
    "once if it has no flat faces."
)
START = "3 of 3  Put its wheel at the beginning of a straight line of {length:g} m. Press Enter there."
ROLL = (
    "        Roll it to the end of the line, straight on and not back. Press Enter there, or at once to leave this out."
)


class Procedure:
    """What was measured so far, and what comes next."""

    def __init__(self, device: Device, length: float, place: str = "") -> None:
        """`device`: with its wheel, if it has one. length: m, of the straight run."""
        self._device = device
        self._length = length
        self._place = place
        self._words = [TURN, FACES, *([START.format(length=length), ROLL] if device.wheel else [])]
        self._step = 0
        self._acceleration: list[Vector] = []
        self._magnetic: list[Vector] = []
        self._recent: deque[Vector] = deque(maxlen=STILL_READINGS)
        self._faces: dict[str, Vector] = {}
        self._ticks: list[tuple[int, int]] = []
        self._count = 0
        self._stride = 1

    @property
    def over(self) -> bool:
        """Every step is done."""
        return self._step >= len(self._words)

    @property
    def words(self) -> str:
        """What to do now."""
        return self._words[self._step]

    def take(self, reading: Reading) -> str:
        """Keep what this step wants of a reading; words for the operator, mostly none."""
        if reading.acceleration is None or reading.magnetic is None:
            return ""
        self._count += 1
        if self._step == 0 and self._count % self._stride == 0:
            self._acceleration.append(reading.acceleration)
            self._magnetic.append(reading.magnetic)
            if len(self._acceleration) >= MAX_READINGS:  # from now on every other one of them
                del self._acceleration[::2], self._magnetic[::2]
                self._stride *= 2
        elif self._step == 1:
            self._recent.append(reading.acceleration)
            return self._new_face() if self._count % LOOK_EVERY == 0 else ""
        elif self._step == 3 and reading.ticks is not None:
            self._ticks.append(reading.ticks)
            if len(self._ticks) >= MAX_READINGS:
                del self._ticks[1:-1:2]
        return ""

    def enter(self) -> None:
        """The operator says that this step is done. Raises OperatorMistake if it is not."""
        if self._step == 0:
            for name, seen in self._seen().items():
                if seen.fraction < LEAST_COVERAGE:
                    raise OperatorMistake(
                        f"the {name} has seen {seen.fraction:.0%} of all directions, wanted {LEAST_COVERAGE:.0%}; "
                        f"go on turning it, these are missing: {seen.in_words()}"
                    )
        self._step += 1

    def status(self) -> str:
        """One line that tells how far the step is."""
        if self._step == 0:
            return f"{len(self._acceleration)} readings | " + " | ".join(
                f"{name} {seen.fraction:.0%}" + (f", missing {seen.in_words(3)}" if seen.missing else ", all")
                for name, seen in self._seen().items()
            )
        if self._step == 1:
            return f"{len(self._faces)} of 6 faces: {' '.join(self._faces) or '-'}"
        return f"{self._count} readings"

    def result(self) -> Calibration:
        """The calibration of all that was measured; raises ScanError where it does not tell enough."""
        return calibration_from_readings(self._device.id, self._readings())

    def _readings(self) -> CalibrationReadings:
        moved = len({*self._ticks}) > 1 and self._device.wheel is not None
        run: dict[str, Any] = {"ticks": self._ticks, "length": self._length}
        if self._device.wheel is not None:
            run["ticks_per_turn"] = self._device.wheel.ticks_per_turn
        return CalibrationReadings(
            place=self._place,
            acceleration=self._acceleration,
            magnetic=self._magnetic,
            faces=list(self._faces.values()),
            run=StraightRun.model_validate(run) if moved else None,
            source=f"{len(self._acceleration)} readings in all directions, {len(self._faces)} faces"
            + (f", a run of {self._length:g} m" if moved else ""),
        )

    def _seen(self) -> dict[str, Coverage]:
        return {"accelerometer": _around(self._acceleration), "magnetometer": _around(self._magnetic)}

    def _new_face(self) -> str:
        rest = at_rest(np.array(self._recent)) if len(self._recent) == STILL_READINGS else None
        if rest is None:
            return ""
        axis = int(np.abs(rest).argmax())
        name = f"{'+' if rest[axis] > 0 else '-'}{'xyz'[axis]}"
        if name in self._faces or np.abs(rest[axis]) < np.cos(TILTED) * np.linalg.norm(rest):
            return ""
        x, y, z = (float(c) for c in rest)
        self._faces[name] = (x, y, z)
        return f"\a        {name} is up: {len(self._faces)} of 6 faces"


def describe(calibration: Calibration) -> list[str]:
    """What was found, in lines for people."""
    sensors = {"accelerometer": calibration.accelerometer, "magnetometer": calibration.magnetometer}
    lines = [
        f"{name}: {sensor.coverage:.0%} of all directions; its vectors' length varied by {sensor.spread_before:.1%}, "
        f"corrected by {sensor.spread_after:.1%}"
        for name, sensor in sensors.items()
        if sensor is not None
    ]
    if calibration.dip is not None:
        before, after = (np.degrees(s or 0.0) for s in (calibration.dip_spread_before, calibration.dip_spread_after))
        lines.append(
            f"field: {np.degrees(calibration.dip):.1f}° below the horizontal; that varied by {before:.1f}°, "
            f"corrected by {after:.1f}°"
        )
    wheel = calibration.circumference
    lines.append(f"wheel: {wheel:.5f} m a turn" if wheel else "wheel: not measured")
    return lines


def _around(vectors: Sequence[Vector]) -> Coverage:
    """Directions of vectors from the middle of their range: of a magnet bolted to the device nothing is known yet."""
    array = np.array(vectors, float).reshape(-1, 3)
    if not len(array):
        return coverage(array)
    low, high = np.percentile(array, [1, 99], axis=0)
    wide = bool(np.all(high - low > 0.5 * (high - low).max()))
    return coverage(array - (low + high) / 2 if wide else array)
