"""Does a phone's orientation mean what we take it to mean? Gravity tells.

Apps differ in the order of a quaternion's components, in its direction and in the sign of accelerations, and do not say
so. A phone at rest settles it: its quaternion (device to ENU) must turn the specific force that it feels upwards.
"""

import math
from collections.abc import Callable

from tracemesh.wire.base import Quaternion, Vector

GRAVITY = 9.81
REST = 0.05
"""Largest deviation of |acceleration| from gravity, as a part of it, at which a phone counts as at rest."""
TOLERANCE = math.cos(math.radians(20))
AGREEING = 20
"""Readings at rest in a row that must agree before anything is said."""
QUARTER_TURN: Quaternion = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""About the vertical: from a world with x North, y West to ENU."""


def unit(quaternion: Quaternion) -> Quaternion | None:
    """The quaternion at length one, or None if it has no direction."""
    length = math.hypot(*quaternion)
    if not 0.1 < length < 10.0:
        return None
    w, x, y, z = (c / length for c in quaternion)
    return (w, x, y, z)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """First b, then a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def inverse(quaternion: Quaternion) -> Quaternion:
    """The inverse of a unit quaternion."""
    w, x, y, z = quaternion
    return (w, -x, -y, -z)


def turn(quaternion: Quaternion, vector: Vector) -> Vector:
    """A vector turned by a unit quaternion."""
    _, x, y, z = product(product(quaternion, (0.0, *vector)), inverse(quaternion))
    return (x, y, z)


def from_vector_part(x: float, y: float, z: float) -> Quaternion:
    """A unit quaternion of which only x, y, z are known and w is not negative."""
    return (math.sqrt(max(0.0, 1.0 - x * x - y * y - z * z)), x, y, z)


def upwards(quaternion: Quaternion, force: Vector) -> float:
    """Cosine of the angle between the specific force, turned to the world, and up; 0 for no force."""
    length = math.hypot(*force)
    return turn(quaternion, force)[2] / length if length else 0.0


def verdict(quaternion: Quaternion, force: Vector) -> str:
    """What is wrong with a reading at rest, in words; empty if nothing is."""
    up = upwards(quaternion, force)
    if up > TOLERANCE:
        return ""
    if up < -TOLERANCE:
        return "its accelerations have the opposite sign"
    if upwards(inverse(quaternion), force) > TOLERANCE:
        return "its quaternion turns the other way round"
    return "its orientation and its acceleration contradict each other"


class PoseCheck:
    """Watches readings at rest and speaks up, once, when enough of them agree that something is wrong."""

    def __init__(self, say: Callable[[str], None]) -> None:
        """`say` is told in words."""
        self._say = say
        self._last = ""
        self._count = 0

    def watch(self, quaternion: Quaternion, force: Vector) -> None:
        """Take one reading into account; force in m/s^2."""
        if abs(math.hypot(*force) - GRAVITY) > REST * GRAVITY:
            return
        found = verdict(quaternion, force)
        self._count = self._count + 1 if found == self._last else 1
        self._last = found
        if found and self._count == AGREEING:
            self._say(f"{found}: what it records will be misread")
