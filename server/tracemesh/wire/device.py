"""The device protocol: a device (or its bridge) sends a recording, the server acknowledges what it has committed.

    device -> hello                       once per connection; names the recording
    server -> welcome {next_seq}          where to go on
    device -> curve.start, samples, node, curve.end     each numbered by `seq`: 0, 1, 2, ... within the recording
              or reading, where the device is an array of sensors
    server -> ack {seq}                   everything up to and including seq is durable
    server -> error {code, message}       the connection closes after it

One number per message, marks included, makes resending harmless and a gap visible: a message that the server has
already is ignored, one that comes too early is refused with the number that was wanted. A recording is what a device
sent, as sent: `hello` and the numbered messages in order, one JSON object a line.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, TypeAdapter, model_validator

from tracemesh.wire.arrays import ArrayReading, SensorArray
from tracemesh.wire.base import (
    LARGEST,
    PROTOCOL_VERSION,
    Count,
    Identifier,
    Measured,
    Message,
    Name,
    Quaternion,
    Ticks,
    UnitQuaternion,
    Vector,
)
from tracemesh.wire.calibration import Calibration

MAX_SAMPLES = 2000
"""Most samples that one message may carry."""


class Wheel(Message):
    """An odometer wheel: distance = (big + small / ticks_per_turn) * circumference."""

    circumference: float = Field(default=0.1, gt=0, le=LARGEST, description="m, travelled in one turn")
    ticks_per_turn: int = Field(default=500, gt=0, le=10**6)
    offset: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="m along (tangent, normal, B): where it measures, from the point of the surface under the sensors",
    )


class Reference(Message):
    """Directions in the world (ENU) that the accelerometer and the magnetometer see at rest."""

    acceleration: Vector = (0.0, 0.0, 1.0)
    magnetic: Vector = (0.5, 0.0, -0.8660254037844386)


class Device(Message):
    """Who measures, and what is needed to read its numbers."""

    id: Identifier
    kind: Identifier = Field(description="morphorider, phone, sensorserver, file, ...")
    name: Name = ""
    wheel: Wheel | None = Field(default=None, description="present when the device counts wheel ticks")
    mounting: UnitQuaternion = Field(
        default=(1.0, 0.0, 0.0, 0.0),
        description="[w, x, y, z]: turns the axes (tangent, normal, B) into the device's own axes",
    )
    reference: Reference = Reference()
    calibration: Calibration | None = Field(
        default=None, description="of this device, chosen by whoever records; the readings are as measured all the same"
    )
    array: SensorArray | None = Field(default=None, description="present when the device is a fixed array of sensors")

    @model_validator(mode="after")
    def _calibrated_itself(self) -> Self:
        if self.calibration is not None and self.calibration.device != self.id:
            raise ValueError(f"wanted a calibration of the device {self.id}, got one of {self.calibration.device}")
        return self


class Hello(Message):
    """First message of every connection and first line of every recording."""

    type: Literal["hello"] = "hello"
    versions: list[int] = Field(default=[PROTOCOL_VERSION], min_length=1, max_length=16)
    recording: Identifier = Field(description="chosen by the device, kept in its spool, the same after a restart")
    session: Identifier | None = Field(default=None, description="session to record into; none: the server makes one")
    device: Device


class Welcome(Message):
    """The server's answer to hello."""

    type: Literal["welcome"] = "welcome"
    version: int
    session: Identifier
    next_seq: Count = Field(description="number of the first message that the server does not have")
    calibration: Name | None = Field(
        default=None, description="the newest one of this device that the server has and the recording does not use"
    )


class CurveStart(Message):
    """A curve begins; its samples and nodes refer to its number."""

    type: Literal["curve.start"] = "curve.start"
    seq: Count
    curve: Count = Field(description="number of the curve within the recording: 0, 1, 2, ...")
    boundary: bool = Field(default=False, description="the curve bounds the surface")


class Samples(Message):
    """A block of samples; every column that is present has one entry per sample.

    Orientation comes as `acceleration` and `magnetic`, or as `quaternion`, or as `tangent` and `normal`; distance as
    `ticks` or `distance`, or not at all (then constant speed along each segment is assumed).
    """

    type: Literal["samples"] = "samples"
    seq: Count
    curve: Count
    first_sample: Count = Field(description="number of the block's first sample within its curve")
    time: list[Measured] | None = Field(default=None, description="s, the device's own clock")
    received: list[Measured] | None = Field(
        default=None, description="s since 1970 UTC, when the bridge had the sample"
    )
    ticks: list[tuple[Ticks, Ticks]] | None = Field(default=None, description="wheel: [big (turns), small]")
    distance: list[Measured] | None = Field(default=None, description="m along the curve")
    acceleration: list[Vector] | None = Field(default=None, description="device axes, up at rest; any unit")
    magnetic: list[Vector] | None = Field(default=None, description="device axes; any unit")
    rotation_rate: list[Vector] | None = Field(default=None, description="rad/s, device axes")
    quaternion: list[Quaternion] | None = Field(default=None, description="[w, x, y, z], device to ENU")
    tangent: list[Vector] | None = Field(default=None, description="unit, world (ENU)")
    normal: list[Vector] | None = Field(default=None, description="unit, outward, world (ENU)")

    @property
    def count(self) -> int:
        """Number of samples in the block."""
        return len(self.acceleration or self.quaternion or self.tangent or ())

    def columns(self) -> dict[str, list[object]]:
        """The columns that are present, by name."""
        return {n: v for n in _COLUMNS if (v := getattr(self, n)) is not None}

    @model_validator(mode="after")
    def _complete(self) -> Self:
        lengths = {n: len(v) for n, v in self.__dict__.items() if type(v) is list}
        if not lengths or len(set(lengths.values())) > 1 or not 1 <= next(iter(lengths.values())) <= MAX_SAMPLES:
            raise ValueError(f"wanted columns of one length between 1 and {MAX_SAMPLES}, got {lengths}")
        vectors = self.acceleration is not None and self.magnetic is not None
        frames = self.tangent is not None and self.normal is not None
        if not (vectors or frames or self.quaternion is not None):
            raise ValueError(
                "wanted an orientation: acceleration and magnetic, or quaternion, or tangent and normal; "
                f"got only {', '.join(lengths)}"
            )
        return self


_COLUMNS = tuple(name for name in Samples.model_fields if name not in ("type", "seq", "curve", "first_sample"))


class NodeMark(Message):
    """A node was marked at a sample of a curve; nodes with the same number are the same point of the object."""

    type: Literal["node"] = "node"
    seq: Count
    curve: Count
    sample: Count = Field(description="number of the sample within its curve")
    node: Count
    undo: bool = Field(default=False, description="takes back the mark of this node at this sample: it was a mistake")


class CurveEnd(Message):
    """A curve ends."""

    type: Literal["curve.end"] = "curve.end"
    seq: Count
    curve: Count
    closed: bool = Field(default=False, description="the curve ends where it began")
    discard: bool = Field(default=False, description="the curve was a mistake: kept as sent, left out of the scan")


class Ack(Message):
    """Every message up to and including `seq` is committed to durable storage."""

    type: Literal["ack"] = "ack"
    seq: Count


class ErrorMessage(Message):
    """Why the server closes the connection."""

    type: Literal["error"] = "error"
    code: Literal["version", "malformed", "gap", "limit", "forbidden", "storage", "unknown"]
    message: str
    expected_seq: Count | None = Field(default=None, description="with `gap`: the number that was wanted")


OfCurve = CurveStart | Samples | NodeMark | CurveEnd
"""What a device that slides along curves sends."""
Recorded = Annotated[OfCurve | ArrayReading, Field(discriminator="type")]
"""What a recording consists of after its hello."""
FromDevice = Annotated[Hello | OfCurve | ArrayReading, Field(discriminator="type")]
ToDevice = Annotated[Welcome | Ack | ErrorMessage, Field(discriminator="type")]

from_device: TypeAdapter[Hello | OfCurve | ArrayReading] = TypeAdapter(FromDevice)
to_device: TypeAdapter[Welcome | Ack | ErrorMessage] = TypeAdapter(ToDevice)
