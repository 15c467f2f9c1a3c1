"""One curve as drawn: dead reckoning from its samples, attached to what is already known of the network."""

from collections.abc import Sequence

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.formats.calibrations import corrections, with_right_wheel
from tracemesh.geometry.rotations import normalized, quaternion_to_matrix
from tracemesh.geometry.scan import Floats, Ints
from tracemesh.geometry.sensing.odometry import COUNTER_RANGE, NOMINAL_SPEED
from tracemesh.geometry.sensing.orientation import ReferenceField, frames_from_quaternions, frames_from_vectors
from tracemesh.wire.base import Vector
from tracemesh.wire.device import Device, Samples

SPACING = 0.003
"""m between drawn points: a wheel stands still at nodes and sends on."""


class CurveDrawing:
    """Positions (m, world) of one curve: a solved beginning, if any, and a dead-reckoned rest from there on."""

    def __init__(self, device: Device, boundary: bool) -> None:
        """An empty curve that starts at the origin."""
        self.device = with_right_wheel(device)
        self._corrections = corrections(device)
        self.boundary = boundary
        self.closed = False
        self.ended = False
        self.attached = False
        self._path = np.empty((0, 3))
        self._sample = np.empty(0, np.int64)
        self._count = 0
        self._here = np.zeros(3)
        self._travelled = 0.0
        self._tangent: Floats | None = None
        self._reading: float | None = None
        self._solved = np.empty((0, 3))
        self._solved_samples = np.empty(0, np.int64)
        self._solved_to = -1
        self._shift = np.zeros(3)

    def extend(self, blocks: Sequence[Samples]) -> tuple[int, Floats, Ints]:
        """Take new samples; number, positions (k, 3) and samples (k,) of the points that they add."""
        before, known = len(self._solved) + len(self._sample) - self._first_after_solved(), len(self._sample)
        added = np.concatenate([self._reckon(block) for block in blocks]) + self._shift
        return before, added, self._sample[known:]

    @property
    def positions(self) -> Floats:
        """All points (n, 3) as drawn."""
        return np.concatenate([self._solved, self._path[self._first_after_solved() :] + self._shift])

    @property
    def samples(self) -> Ints:
        """The sample (n,) that each point is at."""
        return np.concatenate([self._solved_samples, self._sample[self._first_after_solved() :]])

    def position(self, sample: int) -> Floats:
        """Where a sample behind the solved beginning is drawn (3,)."""
        return self._reckoned(sample) + self._shift

    def attach(self, sample: int, position: Floats) -> None:
        """Move the curve so that a sample is where it is known to be."""
        self._shift = position - self._reckoned(sample)
        self.attached = True

    def settle(self, positions: Floats, samples: Ints, last_sample: int) -> None:
        """The curve up to `last_sample` was solved: points (n, 3) at its samples (n,); the rest goes on from there."""
        self._solved, self._solved_samples, self._solved_to = positions, samples, last_sample
        self.attach(last_sample, positions[-1])

    def _first_after_solved(self) -> int:
        return int(np.searchsorted(self._sample, self._solved_to, side="right"))

    def _reckoned(self, sample: int) -> Floats:
        if not len(self._sample):
            return np.zeros(3)
        return np.array([np.interp(sample, self._sample, self._path[:, axis]) for axis in range(3)])

    def _reckon(self, block: Samples) -> Floats:
        """Trapezoid rule along the tangents; keeps a point wherever SPACING was travelled. The points kept (k, 3)."""
        tangents = self._tangents(block)
        steps = self._steps(block)
        before = np.vstack([tangents[:1] if self._tangent is None else self._tangent, tangents[:-1]])
        path = self._here + np.cumsum(steps[:, None] * (before + tangents) / 2, axis=0)
        travelled = self._travelled + np.cumsum(np.abs(steps))
        passed = np.diff(travelled // SPACING, prepend=self._travelled // SPACING) > 0
        passed[0] |= self._count == 0
        self._path = np.concatenate([self._path, path[passed]])
        self._sample = np.concatenate([self._sample, self._count + np.flatnonzero(passed)])
        self._count += len(steps)
        self._here, self._travelled, self._tangent = path[-1], float(travelled[-1]), tangents[-1]
        return path[passed]

    def _tangents(self, block: Samples) -> Floats:
        """Unit tangents (n, 3); where they cannot be told the curve goes straight on."""
        if block.tangent is not None:
            return np.array(block.tangent, float)
        mounting = quaternion_to_matrix(normalized(np.array(self.device.mounting)))
        try:
            if block.quaternion is not None:
                return frames_from_quaternions(np.array(block.quaternion), mounting)[:, :, 0]
            known = self.device.reference
            reference = ReferenceField(known.acceleration, known.magnetic)
            vectors = self._vectors(block.acceleration, "acceleration"), self._vectors(block.magnetic, "magnetic")
            return frames_from_vectors(*vectors, reference, mounting)[:, :, 0]
        except ScanError:
            return np.tile(np.zeros(3) if self._tangent is None else self._tangent, (block.count, 1))

    def _vectors(self, column: Sequence[Vector] | None, name: str) -> Floats:
        """A sensor's vectors (n, 3), corrected if its device is calibrated."""
        vectors = np.array(column, float)
        return self._corrections[name](vectors) if name in self._corrections else vectors

    def _steps(self, block: Samples) -> Floats:
        """Distance (n,) m from the sample before."""
        readings = self._readings(block)
        first = readings[0] if self._reading is None else self._reading
        self._reading = float(readings[-1])
        steps = np.diff(readings, prepend=first)
        if block.distance is None and block.ticks is not None and self.device.wheel is not None:
            span = COUNTER_RANGE * self.device.wheel.circumference
            steps = (steps + span / 2) % span - span / 2
        return steps

    def _readings(self, block: Samples) -> Floats:
        """Odometer (n,) m; nominal speed where nothing measured it."""
        if block.distance is not None:
            return np.array(block.distance, float)
        if block.ticks is not None and self.device.wheel is not None:
            ticks = np.array(block.ticks, float)
            return (ticks[:, 0] + ticks[:, 1] / self.device.wheel.ticks_per_turn) * self.device.wheel.circumference
        if block.time is not None:
            return NOMINAL_SPEED * np.array(block.time, float)
        return np.full(block.count, self._reading or 0.0)


def flat(positions: Floats) -> list[float]:
    """Positions (n, 3) as [x0, y0, z0, x1, ...], to the hundredth of a millimetre."""
    return [float(v) for v in np.round(positions, 5).ravel()]
