"""What all messages share."""

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

PROTOCOL_VERSION = 1
"""Version of the device protocol that this code speaks."""


def _of_length_one(quaternion: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not abs(math.hypot(*quaternion) - 1) < 1e-3:
        raise ValueError(f"wanted a quaternion of length 1, got {quaternion}")
    return quaternion


LARGEST = 1e12
"""In whatever unit: m, s, m/s^2, µT, rad/s or what a device counts in."""
Measured = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
"""A number that a device says: what is larger is no measurement, and might not stay finite when it is reckoned with."""
Vector = tuple[Measured, Measured, Measured]
Quaternion = tuple[Measured, Measured, Measured, Measured]
"""[w, x, y, z], device to world (ENU)."""
Coordinates = tuple[float, float, float]
"""Three numbers that were reckoned here."""
UnitQuaternion = Annotated[Quaternion, AfterValidator(_of_length_one)]
"""[w, x, y, z], a rotation, rounded to at least three decimals."""
Count = Annotated[int, Field(ge=0, le=2**53 - 1)]
Ticks = Annotated[int, Field(ge=-(2**31), le=2**31 - 1)]
"""What a wheel counts: whole turns, and parts of them."""
Identifier = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")]
"""Chosen by whoever creates the thing; safe in a URL and in a file name."""

Name = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
"""For people: one line of text."""


class Message(BaseModel):
    """A frozen message that refuses fields it does not know and numbers that are not finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
