"""Fixed arrays that move, and the truth: sensors on a sheet that bends without stretching, along parallel rulings.

An inextensible sheet keeps all distances between sensors, as a real ribbon or fabric does. Its profile across the
rulings has the tangent angle theta(s, time); everything else follows from it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.rotations import normalized
from tracemesh.geometry.sensing.orientation import ReferenceField
from tracemesh.geometry.sensor_array import SensorArray, SensorCurve

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ALONG_X = np.column_stack([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""Mounting of curves whose sensors have x along the curve and z outward."""
ALONG_Y = np.column_stack([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
"""Mounting of curves whose sensors have y along the curve and z outward."""
NOISE = 0.005
"""Of a unit vector, per axis: a good sensor at rest."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)


@dataclass(frozen=True)
class Bending:
    """How a sheet bends. angle: profile's tangent angle, rad, at (s (n,) m, time s); direction: of the profile in the
    flat sheet, rad from x, at a time.
    """

    angle: Callable[[Floats, float], Floats]
    direction: Callable[[float], float]


@dataclass(frozen=True)
class MovingArray:
    """An array on a bending sheet. flat: (s, 2) m, where its sensors are on the flat sheet."""

    array: SensorArray
    flat: Floats
    bending: Bending

    def positions(self, time: float, flat: Floats | None = None) -> Floats:
        """Where points (n, 2) of the flat sheet are, by default the sensors: (n, 3) m, world."""
        along, across, axes = self._profile(self.flat if flat is None else flat, time)
        half = along[:, None] / 2
        angle = self.bending.angle((half + half * _NODES).ravel(), time).reshape(len(along), -1)
        x, z = ((half * wave(angle)) @ _WEIGHTS for wave in (np.cos, np.sin))
        result: Floats = np.column_stack([x, across, z]) @ axes
        return result

    def rotations(self, time: float, flat: Floats | None = None) -> Floats:
        """Sensor -> world (n, 3, 3): x and y of the flat sheet, z outward."""
        along, _, axes = self._profile(self.flat if flat is None else flat, time)
        angle = self.bending.angle(along, time)
        zero, one = np.zeros_like(angle), np.ones_like(angle)
        profile = np.stack([np.cos(angle), zero, np.sin(angle)], axis=1) @ axes
        ruling = np.stack([zero, one, zero], axis=1) @ axes
        c, s = axes[0, :2]
        x, y = c * profile - s * ruling, s * profile + c * ruling
        return np.stack([x, y, np.cross(profile, ruling)], axis=2)

    def vectors(
        self, time: float, field: ReferenceField, noise: float, generator: np.random.Generator
    ) -> tuple[Floats, Floats]:
        """What accelerometers and magnetometers (s, 3) measure, in units of the field's vectors."""
        rotations = self.rotations(time)
        directions = (normalized(np.array(v)) for v in (field.acceleration, field.magnetic))
        first, second = (v @ rotations + generator.normal(0.0, noise, (len(rotations), 3)) for v in directions)
        return first, second

    def _profile(self, flat: Floats, time: float) -> tuple[Floats, Floats, Floats]:
        """Coordinates (n,) along the profile and along the rulings, and their axes (3, 3) as rows."""
        direction = self.bending.direction(time)
        c, s = np.cos(direction), np.sin(direction)
        axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return flat @ axes[0, :2], flat @ axes[1, :2], axes


def rolling(length: float, period: float = 8.0) -> Bending:
    """From straight to nine tenths of a circle of a given length, m, and back in a period, s."""
    most = 0.9 * 2 * np.pi / length

    def angle(along: Floats, time: float) -> Floats:
        result: Floats = most * (1 - np.cos(2 * np.pi * time / period)) / 2 * along
        return result

    return Bending(angle, lambda time: 0.0)


def waving(length: float, period: float = 4.0) -> Bending:
    """Waves of a given length, m, and period, s, whose direction goes round in ten periods."""

    def angle(along: Floats, time: float) -> Floats:
        return 0.7 * np.sin(2 * np.pi * (along / length - time / period))

    return Bending(angle, lambda time: 2 * np.pi * time / (10 * period))


def ribbon(sensors: int = 8, spacing: float = 0.1) -> MovingArray:
    """Sensors in a row, m apart, that roll up."""
    place = spacing * (np.arange(sensors) - (sensors - 1) / 2)
    curve = _row(np.arange(sensors), spacing, ALONG_X)
    flat = np.column_stack([place, np.zeros(sensors)])
    return MovingArray(SensorArray((curve,)), flat, rolling(spacing * (sensors - 1)))


def comb(teeth: int = 5, sensors: int = 4, spacing: float = 0.1) -> MovingArray:
    """A waving spine of `teeth` sensors along x; from each starts a tooth along y that has so many sensors in all."""
    grid = _grid(sensors, teeth)
    spine = _row(grid[0], spacing, ALONG_X)
    return _on_grid(grid, spacing, (spine, *(_row(column, spacing, ALONG_Y) for column in grid.T)))


def lattice(rows: int = 8, columns: int = 8, spacing: float = 0.05) -> MovingArray:
    """A waving fabric of rows along x and columns along y; the outer ones bound the surface."""
    grid = _grid(rows, columns)
    along_x = (_row(row, spacing, ALONG_X, i in (0, rows - 1)) for i, row in enumerate(grid))
    along_y = (_row(column, spacing, ALONG_Y, i in (0, columns - 1)) for i, column in enumerate(grid.T))
    return _on_grid(grid, spacing, (*along_x, *along_y))


def _grid(rows: int, columns: int) -> Ints:
    return np.arange(rows * columns).reshape(rows, columns)


def _row(sensors: Ints, spacing: float, mounting: Floats, boundary: bool = False) -> SensorCurve:
    mountings = np.tile(mounting, (len(sensors), 1, 1))
    return SensorCurve(sensors, np.full(len(sensors) - 1, spacing), mountings, boundary)


def _on_grid(grid: Ints, spacing: float, curves: tuple[SensorCurve, ...]) -> MovingArray:
    rows, columns = grid.shape
    y, x = np.divmod(np.arange(grid.size), columns)
    flat = spacing * np.column_stack([x - (columns - 1) / 2, y - (rows - 1) / 2])
    return MovingArray(SensorArray(curves), flat, waving(1.5 * spacing * max(columns - 1, rows - 1)))


ARRAYS: dict[str, Callable[[], MovingArray]] = {"ribbon": ribbon, "comb": comb, "lattice": lattice}
"""Built-in arrays by name."""
