"""Fixed arrays: many sensors at known places along curves, all read at once; each reading is a whole network.

A ribbon is one curve; a comb is a spine and its teeth; a lattice is rows and columns. Where two curves share a sensor
they cross, and the sensor is a node of the network.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from tracemesh.wire.base import LARGEST, Count, Measured, Message, Quaternion, UnitQuaternion, Vector

MAX_SENSORS = 2000
"""Most sensors of one array."""
Sensor = Annotated[int, Field(ge=0, lt=MAX_SENSORS)]
"""Number of a sensor: its row in every reading."""
Spacing = Annotated[float, Field(gt=0, le=LARGEST)]


class ArrayCurve(Message):
    """Sensors in a row along one curve."""

    sensors: list[Sensor] = Field(min_length=2, description="in their order along the curve, none twice")
    spacing: list[Spacing] = Field(
        description="m along the curve from each sensor to the next; of a closed curve also from the last to the first"
    )
    boundary: bool = Field(default=False, description="the curve bounds the surface")
    closed: bool = Field(default=False, description="the last sensor is followed by the first")
    mounting: list[UnitQuaternion] = Field(
        default=[(1.0, 0.0, 0.0, 0.0)],
        description="[w, x, y, z]: turns this curve's axes (tangent, normal, B) into a sensor's own axes, after which "
        "the device's mounting does; one for all of its sensors, or one for each",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(set(self.sensors)) < len(self.sensors):
            raise ValueError(f"wanted every sensor once on a curve, got {self.sensors}")
        if self.closed and len(self.sensors) < 3:
            raise ValueError(f"wanted three sensors or more on a closed curve, got {len(self.sensors)}")
        gaps = len(self.sensors) - (not self.closed)
        if len(self.spacing) != gaps:
            raise ValueError(f"wanted {gaps} spacings between {len(self.sensors)} sensors, got {len(self.spacing)}")
        if len(self.mounting) not in (1, len(self.sensors)):
            raise ValueError(
                f"wanted one mounting, or {len(self.sensors)} as there are sensors, got {len(self.mounting)}"
            )
        return self


class SensorArray(Message):
    """Which sensors are where along which curves."""

    curves: list[ArrayCurve] = Field(min_length=1, max_length=MAX_SENSORS)

    @property
    def sensor_count(self) -> int:
        """Number of sensors: rows of a reading."""
        return 1 + max(max(curve.sensors) for curve in self.curves)

    @model_validator(mode="after")
    def _whole(self) -> Self:
        missing = set(range(self.sensor_count)).difference(*(curve.sensors for curve in self.curves))
        if missing:
            raise ValueError(
                f"wanted every sensor from 0 to {self.sensor_count - 1} on a curve, got none {min(missing)}"
            )
        reached = set(self.curves[0].sensors)
        rest = [set(curve.sensors) for curve in self.curves[1:]]
        while joined := [sensors for sensors in rest if sensors & reached]:
            rest = [sensors for sensors in rest if not sensors & reached]
            reached.update(*joined)
        if rest:
            raise ValueError(f"wanted curves that hang together, got one with sensor {min(rest[0])} that crosses none")
        return self


class ArrayReading(Message):
    """What all sensors of an array measured at one time; every column has one row per sensor.

    The message's own number, `seq`, is the reading's: an array's recording consists of nothing else.
    """

    type: Literal["reading"] = "reading"
    seq: Count
    time: Measured = Field(description="s, the device's own clock")
    received: Measured | None = Field(default=None, description="s since 1970 UTC, when the bridge had the reading")
    acceleration: list[Vector] | None = Field(default=None, description="sensor axes, up at rest; any unit")
    magnetic: list[Vector] | None = Field(default=None, description="sensor axes; any unit")
    quaternion: list[Quaternion] | None = Field(default=None, description="[w, x, y, z], sensor to ENU")

    @property
    def count(self) -> int:
        """Number of sensors."""
        return len(self.quaternion or self.acceleration or ())

    @model_validator(mode="after")
    def _complete(self) -> Self:
        columns = {n: len(v) for n in ("acceleration", "magnetic", "quaternion") if (v := getattr(self, n)) is not None}
        if len(set(columns.values())) != 1 or not 1 <= self.count <= MAX_SENSORS:
            raise ValueError(f"wanted columns of one length between 1 and {MAX_SENSORS}, got {columns}")
        if self.quaternion is None and columns.keys() != {"acceleration", "magnetic"}:
            raise ValueError(f"wanted an orientation: acceleration and magnetic, or quaternion; got only {[*columns]}")
        return self


def misfit(array: SensorArray | None, reading: ArrayReading) -> str:
    """Why a reading is not one of an array, in words; empty if it is."""
    if array is None:
        return "a reading from a device whose hello has no array"
    if reading.count != array.sensor_count:
        return f"wanted {array.sensor_count} sensors, as the hello's array has, got {reading.count}"
    return ""
