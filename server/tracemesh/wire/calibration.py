"""What is known of one device's sensors and wheel, and how it was found.

Readings stay as the device sent them; a calibration is applied to them afterwards, when somebody chose it.
"""

from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from tracemesh.wire.base import LARGEST, Identifier, Message, Name, Ticks, UnitQuaternion, Vector

MAX_READINGS = 20_000
"""Most readings of which a calibration is made: more make it slower, not better."""
Version = Annotated[int, Field(ge=1, le=2**31 - 1)]
"""Calibrations of a device are numbered 1, 2, 3, ... as they come; no number is used twice."""
Run = list[tuple[Ticks, Ticks]]
"""Wheel ticks [big (turns), small], in order."""


class SensorCorrection(Message):
    """Right vector = matrix (measured - offset), both in the sensor's own unit."""

    matrix: tuple[Vector, Vector, Vector] = Field(description="rows; determinant about 1")
    offset: Vector
    coverage: float = Field(ge=0, le=1, description="part of all directions in which it was measured")
    spread_before: float = Field(ge=0, description="standard deviation of the vectors' lengths over their mean")
    spread_after: float = Field(ge=0)

    @model_validator(mode="after")
    def _invertible(self) -> Self:
        (a, b, c), (d, e, f), (g, h, i) = self.matrix
        determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
        if not 1e-3 < determinant < 1e3:
            raise ValueError(f"wanted a matrix with a determinant of about 1, got {determinant:.3g}")
        return self


class Calibration(Message):
    """One calibration of one device."""

    format: Literal["tracemesh-calibration"] = "tracemesh-calibration"
    device: Identifier
    version: Version | None = Field(default=None, description="none: no server has it yet")
    made: AwareDatetime
    place: Name = Field(default="", description="where, for people")
    accelerometer: SensorCorrection | None = None
    magnetometer: SensorCorrection | None = None
    alignment: UnitQuaternion = Field(
        default=(1.0, 0.0, 0.0, 0.0),
        description="[w, x, y, z]: turns the magnetometer's corrected vectors into the accelerometer's axes",
    )
    dip: float | None = Field(default=None, description="rad, of the field below the horizontal, as corrected")
    dip_spread_before: float | None = Field(default=None, ge=0, description="rad, standard deviation over all poses")
    dip_spread_after: float | None = Field(default=None, ge=0)
    circumference: float | None = Field(default=None, gt=0, le=LARGEST, description="of the wheel, m")
    source: Name = Field(default="", description="which readings it was made of, for people")

    @model_validator(mode="after")
    def _corrects_something(self) -> Self:
        if (self.accelerometer is None) != (self.magnetometer is None):
            raise ValueError("wanted accelerometer and magnetometer, got only one of them")
        if self.accelerometer is None and self.circumference is None:
            raise ValueError("wanted accelerometer and magnetometer, or circumference, got neither")
        return self

    @property
    def label(self) -> str:
        """What people call it."""
        number = f"calibration {self.version}" if self.version else "calibration"
        return f"{number} of {self.device}, {self.made:%Y-%m-%d}"


class StraightRun(Message):
    """A straight run whose length a ruler measured."""

    ticks: Run = Field(min_length=2, max_length=MAX_READINGS)
    ticks_per_turn: int = Field(default=500, gt=0, le=10**6)
    length: float = Field(ge=1e-3, le=1e4, description="m")


class CalibrationReadings(Message):
    """What a calibration is made of: poses all around, faces that the device lay on, a straight run; any of the first
    and the last.
    """

    made: AwareDatetime | None = Field(default=None, description="none: now")
    place: Name = ""
    acceleration: list[Vector] = Field(default=[], max_length=MAX_READINGS, description="as measured, up at rest")
    magnetic: list[Vector] = Field(
        default=[], max_length=MAX_READINGS, description="as measured, one for each of these"
    )
    faces: list[Vector] = Field(
        default=[], max_length=100, description="accelerations at rest on faces of the case, one for each"
    )
    run: StraightRun | None = None
    source: Name = ""

    @model_validator(mode="after")
    def _tells_something(self) -> Self:
        if len(self.acceleration) != len(self.magnetic):
            raise ValueError(f"wanted as many magnetic vectors as accelerations, got {len(self.magnetic)}")
        if not self.acceleration and self.run is None:
            raise ValueError("wanted acceleration and magnetic, or run, got neither")
        return self


class CalibrationCreate(Message):
    """POST /devices/{device}/calibrations: one that is ready, or readings of which the server makes one."""

    calibration: Calibration | None = None
    readings: CalibrationReadings | None = None
    kind: Identifier = Field(default="unknown", description="of the device, if the server does not know it yet")

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.calibration is None) == (self.readings is None):
            raise ValueError("wanted either calibration or readings")
        return self


class KnownDevice(Message):
    """A device that has sent something to this server."""

    id: Identifier
    kind: Identifier
    name: Name
    first_seen: datetime
    last_seen: datetime = Field(description="when it last began or went on with a recording, or was calibrated")
    calibrations: int = Field(ge=0, description="how many of its calibrations are stored")
