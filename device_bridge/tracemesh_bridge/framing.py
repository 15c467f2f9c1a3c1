"""Bytes to Morphorider frames and back. Pure: no port, no clock, no state.

A frame is what the device answers to one request byte. Which bytes mean what is data, a `FrameLayout`, because only
one device is known and its firmware is not: the thesis (section 5.2.1) gives 22 bytes of signed 16-bit integers, "first
bit represents the sign", with two counts of wheel ticks and three integers each for accelerometer and magnetometer,
mapped to [-1, 1]. That names 16 of the 22 bytes; the default layout takes the last six for reserved.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from tracemesh.wire.base import Vector
from tracemesh_bridge.errors import BridgeError, FrameError

Sign = Literal["twos-complement", "sign-magnitude", "unsigned"]
Meaning = Literal[
    "big", "small",
    "acceleration_x", "acceleration_y", "acceleration_z",
    "magnetic_x", "magnetic_y", "magnetic_z",
]  # fmt: skip
"""What a frame must hold: whole wheel turns, ticks within a turn, and two vectors in the device's axes."""
MEANINGS: tuple[Meaning, ...] = get_args(Meaning)


class FrameField(BaseModel):
    """One integer of a frame."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    name: Meaning | Literal["reserved"]
    offset: int = Field(ge=0, description="first byte within the frame")
    size: Literal[1, 2, 4] = Field(default=2, description="bytes")
    order: Literal["big", "little"] = "big"
    sign: Sign = "twos-complement"
    scale: float = Field(default=1.0, description="value = integer * scale")

    @property
    def end(self) -> int:
        """First byte after the field."""
        return self.offset + self.size

    def integer(self, frame: bytes) -> int:
        """The integer in a frame, before scaling."""
        raw = int.from_bytes(frame[self.offset : self.end], self.order)
        top = 1 << (8 * self.size - 1)
        if self.sign == "unsigned" or raw < top:
            return raw
        return raw - 2 * top if self.sign == "twos-complement" else top - raw

    def raw(self, integer: int) -> bytes:
        """The bytes of an integer, the inverse of `integer`. Raises FrameError if it does not fit."""
        top = 1 << (8 * self.size - 1)
        lowest = {"twos-complement": -top, "sign-magnitude": 1 - top, "unsigned": 0}[self.sign]
        highest = 2 * top - 1 if self.sign == "unsigned" else top - 1
        if not lowest <= integer <= highest:
            raise FrameError(f"{self.name}: wanted an integer in [{lowest}, {highest}], got {integer}")
        if integer < 0:
            integer = integer + 2 * top if self.sign == "twos-complement" else top - integer
        return integer.to_bytes(self.size, self.order)


def _default_fields() -> tuple[FrameField, ...]:
    ticks = (FrameField(name="big", offset=0), FrameField(name="small", offset=2))
    vectors = (FrameField(name=name, offset=2 * i, scale=1 / 32768) for i, name in enumerate(MEANINGS) if i > 1)
    return (*ticks, *vectors, *(FrameField(name="reserved", offset=offset) for offset in (16, 18, 20)))


class FrameLayout(BaseModel):
    """Where everything is in a frame. The default is eleven big-endian 16-bit integers in two's complement."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    length: int = Field(default=22, ge=1, le=256, description="bytes in a frame")
    request: int = Field(default=ord("Q"), ge=0, le=255, description="byte that asks for a frame")
    ticks_per_turn: int = Field(default=500, gt=0, description="small ticks in one turn of the wheel")
    fields: tuple[FrameField, ...] = Field(default_factory=_default_fields)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        names = sorted(f.name for f in self.fields if f.name != "reserved")
        if names != sorted(MEANINGS):
            raise ValueError(f"wanted each of {', '.join(MEANINGS)} once, got {', '.join(names) or 'none'}")
        placed = sorted(self.fields, key=lambda f: f.offset)
        if placed[-1].end > self.length:
            raise ValueError(f"{placed[-1].name} ends at byte {placed[-1].end} of {self.length}")
        for a, b in pairwise(placed):
            if a.end > b.offset:
                raise ValueError(f"{a.name} and {b.name} overlap at byte {b.offset}")
        return self

    @property
    def unknown(self) -> tuple[int, ...]:
        """Bytes of the frame whose meaning is not known."""
        known = {i for f in self.fields if f.name != "reserved" for i in range(f.offset, f.end)}
        return tuple(i for i in range(self.length) if i not in known)


@dataclass(frozen=True)
class Frame:
    """One measurement: wheel counts (turns, ticks) and two vectors in the device's axes, 1 being full scale."""

    ticks: tuple[int, int]
    acceleration: Vector
    magnetic: Vector


def read_layout(path: Path) -> FrameLayout:
    """A layout from a JSON file. Raises BridgeError that says where and why it is none."""
    try:
        return FrameLayout.model_validate_json(path.read_bytes())
    except OSError as error:
        raise BridgeError(f"cannot read the frame layout {path}: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "top"
        raise BridgeError(f"{path} is no frame layout: {where}: {first['msg']}") from error


def decode(layout: FrameLayout, data: bytes) -> Frame:
    """The frame in exactly `layout.length` bytes. Raises FrameError if there are more or fewer, or it makes no sense.

    Any bytes of the right length decode to numbers; what no device can mean is refused: ticks beyond one turn, and a
    vector that is exactly zero.
    """
    if len(data) != layout.length:
        raise FrameError(f"wanted {layout.length} bytes, got {len(data)}")
    integers: dict[str, int] = {f.name: f.integer(data) for f in layout.fields if f.name != "reserved"}
    scales: dict[str, float] = {f.name: f.scale for f in layout.fields}
    if abs(integers["small"]) >= layout.ticks_per_turn:
        raise FrameError(f"wanted fewer than {layout.ticks_per_turn} small ticks, got {integers['small']}")
    values = {name: integer * scales[name] for name, integer in integers.items()}
    acceleration, magnetic = (_vector(values, sensor) for sensor in ("acceleration", "magnetic"))
    if not any(acceleration) or not any(magnetic):
        raise FrameError("wanted two directions, got a vector of zeros")
    return Frame((integers["big"], integers["small"]), acceleration, magnetic)


def encode(layout: FrameLayout, frame: Frame) -> bytes:
    """The bytes a device would send, zero where nothing is known. Raises FrameError if a value does not fit."""
    values = dict(zip(MEANINGS, (*frame.ticks, *frame.acceleration, *frame.magnetic), strict=True))
    data = bytearray(layout.length)
    for f in layout.fields:
        if f.name != "reserved":
            data[f.offset : f.end] = f.raw(round(values[f.name] / f.scale))
    return bytes(data)


def _vector(values: dict[str, float], sensor: str) -> Vector:
    return (values[f"{sensor}_x"], values[f"{sensor}_y"], values[f"{sensor}_z"])
