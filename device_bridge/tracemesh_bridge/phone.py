"""What all phones have in common: many sensors that speak one by one, a clock of their own, a doubtful pose."""

from collections.abc import Callable
from typing import Literal

from tracemesh.wire.base import LARGEST, Quaternion, Vector
from tracemesh_bridge.health import Health
from tracemesh_bridge.pose import PoseCheck, unit
from tracemesh_bridge.source import Reading

MOUNTING: Quaternion = (0.5, 0.5, 0.5, 0.5)
"""A phone lies on the surface with its back and moves towards its top: t = y, N = z, B = x of the device."""
JUMP = 1.0
"""s by which a phone's clock may run ahead of the arrival of its readings, from one to the next, and be believed."""
Sensor = Literal["acceleration", "magnetic", "rotation_rate"]


class SteadyTime:
    """A phone's clock with its jumps taken out: the device's own time between readings, whatever it calls the hour."""

    def __init__(self, health: Health) -> None:
        """Jumps are counted by `health`."""
        self._health = health
        self._offset = 0.0
        self._step = 0.0
        self._last: tuple[float, float] | None = None

    def follow(self, time: float, received: float) -> float:
        """Time of a reading, s, increasing. A clock that was set back, or far ahead, goes on from where it was."""
        if self._last is not None:
            step, passed = time - self._last[0], received - self._last[1]
            if step <= 0 or step - passed > JUMP:
                self._health.fault("clock jump")
                self._offset += max(passed, self._step) - step
            else:
                self._step = step
        self._last = (time, received)
        return time + self._offset


class Assembler:
    """Makes readings of what the sensors say one by one: one for each orientation, with the newest of the others."""

    def __init__(self, health: Health, say: Callable[[str], None]) -> None:
        """Faults are counted by `health`; `say` is told if the pose is wrong."""
        self._health = health
        self._time = SteadyTime(health)
        self._pose = PoseCheck(say)
        self._newest: dict[Sensor, Vector] = {}
        self._last: tuple[float, Quaternion | None] | None = None

    def sense(self, sensor: Sensor, vector: Vector) -> None:
        """Keep the newest value of a sensor. Acceleration in m/s^2, up at rest; rotation rate in rad/s."""
        if max(map(abs, vector)) > LARGEST:
            self._health.fault("implausible")
        else:
            self._newest[sensor] = vector

    def orient(self, time: float, quaternion: Quaternion, received: float) -> Reading | None:
        """The reading at an orientation (device to ENU); None if that is no rotation, at no time, or the same again."""
        rotation = unit(quaternion)
        if rotation is None or abs(time) > LARGEST:
            self._health.fault("implausible")
            return None
        if self._last == (time, quaternion):
            self._health.fault("repeated")
            return None
        self._last = (time, quaternion)
        if "acceleration" in self._newest:
            self._pose.watch(rotation, self._newest["acceleration"])
        return self._reading(time, received, rotation)

    def raw(self, time: float, received: float) -> Reading | None:
        """The reading at a sample of the gyroscope, whose orientation is found later from all three sensors.

        None until all have spoken, or if it is the same sample again.
        """
        if not {"acceleration", "magnetic", "rotation_rate"} <= self._newest.keys():
            return None
        if abs(time) > LARGEST:
            self._health.fault("implausible")
            return None
        if self._last == (time, None):
            self._health.fault("repeated")
            return None
        self._last = (time, None)
        return self._reading(time, received, None)

    def _reading(self, time: float, received: float, rotation: Quaternion | None) -> Reading:
        reading = Reading(
            received=received,
            time=self._time.follow(time, received),
            quaternion=rotation,
            acceleration=self._newest.get("acceleration"),
            magnetic=self._newest.get("magnetic"),
            rotation_rate=self._newest.get("rotation_rate"),
        )
        self._health.take(reading)
        return reading
