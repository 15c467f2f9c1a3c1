"""A fixed array of sensors as the kernel takes it: which sensors are where along which curves."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class SensorCurve:
    """Sensors in a row along one curve.

    sensors: (m,) numbers, none twice. spacing: (m - 1,) m along the curve from each to the next; (m,) on a closed
    curve, whose last sensor is followed by its first. mounting: (m, 3, 3) maps (t, N, B) coordinates of the curve to
    the axes of each of its sensors. boundary: the curve bounds the surface.
    """

    sensors: Ints
    spacing: Floats
    mounting: Floats
    boundary: bool = False
    closed: bool = False

    def starting_at(self, place: int) -> "SensorCurve":
        """The same closed curve begun at the sensor at a place along it."""
        return SensorCurve(
            np.roll(self.sensors, -place),
            np.roll(self.spacing, -place),
            np.roll(self.mounting, -place, axis=0),
            self.boundary,
            self.closed,
        )


@dataclass(frozen=True)
class SensorArray:
    """Curves that hang together at the sensors that they share."""

    curves: tuple[SensorCurve, ...]

    @cached_property
    def sensor_count(self) -> int:
        """Number of sensors."""
        return 1 + max(int(curve.sensors.max()) for curve in self.curves)

    @cached_property
    def nodes(self) -> Ints:
        """Sensors (k,), increasing, that are nodes: those that curves share, and the ends of open curves."""
        uses = np.bincount(np.concatenate([c.sensors for c in self.curves]), minlength=self.sensor_count)
        ends = [c.sensors[[0, -1]] for c in self.curves if not c.closed]
        result: Ints = np.unique(np.concatenate([np.flatnonzero(uses > 1), *ends])).astype(np.int64)
        return result

    @property
    def encloses(self) -> bool:
        """Whether the curves enclose anything, so that there can be a surface."""
        segments = sum(np.count_nonzero(np.isin(c.sensors, self.nodes)) - (not c.closed) for c in self.curves)
        return bool(any(c.closed for c in self.curves) or segments >= len(self.nodes))
