"""A Morphorider that scans a known shape, simulated in time: what its sensors say, and what the operator presses.

    plan = plan_scan(leaf(), seed=1)                # where the device is at any time, and the keys pressed
    plan.readings(time, generator)                  # its raw numbers at any times: what the virtual device answers
    simulate_scan(plan, seed=1)                     # all curves as a host at 60 Hz records them

Times are s from the start of the session, lengths m. Vectors are unit vectors in the device's axes (t, N, B), measured
as m = A^T e (thesis, section 3.4); the magnetic one is turned by a constant heading error per curve.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from tracemesh.geometry.rotations import exp
from tracemesh.geometry.scan import CurveScan, Floats, Ints, Scan
from tracemesh.geometry.simulated.shape_curves import ShapeCurve
from tracemesh.geometry.simulated.shapes import Shape

WHEEL_CIRCUMFERENCE = 0.1
TICKS_PER_TURN = 500
FULL_SCALE = 2.0
"""Length of a sensor vector, in units of the undisturbed field, that reads as the largest 16-bit integer."""
COUNTS = 32767
REFERENCE_ACCELERATION = (0.0, 0.0, 1.0)
REFERENCE_MAGNETIC = (0.5, 0.0, -(0.75**0.5))


@dataclass(frozen=True)
class Handling:
    """How the operator moves the device. speed: m/s; acceleration: m/s^2; pause at nodes and way between curves: s."""

    speed: float = 0.08
    acceleration: float = 0.25
    pause: float = 1.0
    lift: float = 1.5
    rate: float = 60.0
    """Readings per second of the host."""


@dataclass(frozen=True)
class Imperfections:
    """vector: standard deviation per axis of a unit vector; outliers: part of readings that are pure chance;
    heading: standard deviation of a curve's heading error, rad; mark: of the place where a node is marked, m.
    """

    vector: float = 0.015
    outliers: float = 0.004
    heading: float = float(np.radians(1.5))
    mark: float = 0.001

    def scaled(self, factor: float) -> Self:
        """All of them larger or smaller by a factor."""
        return type(self)(*(factor * v for v in (self.vector, self.outliers, self.heading, self.mark)))


@dataclass(frozen=True)
class KeyPress:
    """What the operator tells at a time: a curve begins, the device is on a node (its number), the curve ends."""

    time: float
    key: Literal["boundary", "interior", "node", "end"]
    node: int | None = None


@dataclass(frozen=True)
class Readings:
    """Raw numbers of the device. ticks: (n, 2) turns and 1/500 turns since it was switched on (16 bits, wrapping);
    acceleration, magnetic: (n, 3) 16-bit integers, COUNTS for FULL_SCALE.
    """

    ticks: Ints
    acceleration: Ints
    magnetic: Ints


@dataclass(frozen=True)
class ScanPlan:
    """The motion of a whole session: constant acceleration from each row to the next.

    time, travelled (wheel), position (along the curve), speed, acceleration: (k,); curve: (k,) index of the curve on
    which the device stands, or over which it waits before `boundary` or `interior` is pressed. heading: (c,) rad.
    """

    curves: tuple[ShapeCurve, ...]
    time: Floats
    travelled: Floats
    position: Floats
    speed: Floats
    acceleration: Floats
    curve: Ints
    heading: Floats
    keys: tuple[KeyPress, ...]
    imperfections: Imperfections
    handling: Handling

    @property
    def duration(self) -> float:
        """From switching on to the end of the last curve, s."""
        return float(self.time[-1])

    def readings(self, time: Floats, generator: np.random.Generator) -> Readings:
        """What the device answers at times (n,); after the end it stays where it is."""
        curve, travelled, position = self._state(time)
        vectors = np.empty((2, len(time), 3))
        for index in np.unique(curve):
            on = curve == index
            vectors[:, on] = _vectors(self.curves[index].at(position[on])[1], float(self.heading[index]))
        return raw_readings(travelled, vectors, self.imperfections, generator)

    def _state(self, time: Floats) -> tuple[Ints, Floats, Floats]:
        """Curve, wheel's way and position along the curve at times (n,)."""
        row = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 1)
        since = np.where(row < len(self.time) - 1, time - self.time[row], 0.0).clip(0.0)
        moved = since * (self.speed[row] + since * self.acceleration[row] / 2)
        return self.curve[row], self.travelled[row] + moved, self.position[row] + moved


@dataclass(frozen=True)
class SimulatedCurve:
    """One curve as a host records it: times (n,) s, the device's raw numbers, samples at which nodes were marked."""

    time: Floats
    readings: Readings
    node_samples: Ints
    node_ids: Ints
    boundary: bool
    closed: bool


def raw_readings(
    travelled: Floats, vectors: Floats, imperfections: Imperfections, generator: np.random.Generator
) -> Readings:
    """What the device answers whose wheel has gone (n,) m and whose sensors see vectors (2, n, 3), device axes."""
    ticks = np.floor(travelled * (TICKS_PER_TURN / WHEEL_CIRCUMFERENCE) + 1e-6).astype(np.int64)
    turns, small = np.divmod(ticks, TICKS_PER_TURN)
    acceleration, magnetic = _counts(_disturbed(vectors, imperfections, generator))
    return Readings(np.column_stack([_wrapped(turns), small]), acceleration, magnetic)


def plan_scan(
    shape: Shape,
    handling: Handling = Handling(),
    imperfections: Imperfections = Imperfections(),
    seed: int = 0,
) -> ScanPlan:
    """Plan of a session that scans all curves of a shape, one after the other; the seed fixes marks and headings."""
    generator = np.random.default_rng(seed)
    motion = _Motion(handling)
    for index, curve in enumerate(shape.curves):
        motion.scan(index, curve, generator.normal(0.0, imperfections.mark, len(curve.node_positions)))
    heading = generator.normal(0.0, imperfections.heading, len(shape.curves))
    return motion.plan(shape.curves, heading, imperfections)


def simulate_scan(plan: ScanPlan, seed: int = 0) -> tuple[SimulatedCurve, ...]:
    """All curves of a plan as a host records them that asks at the plan's rate; the seed fixes the sensors' noise."""
    generator = np.random.default_rng(seed)
    starts = [k for k in plan.keys if k.key in ("boundary", "interior")]
    ends = [k for k in plan.keys if k.key == "end"]
    curves = []
    for curve, start, end in zip(plan.curves, starts, ends, strict=True):
        time = np.arange(start.time, end.time, 1 / plan.handling.rate)
        marks = [k for k in plan.keys if k.key == "node" and start.time <= k.time <= end.time]
        samples = np.searchsorted(time, [k.time for k in marks]).clip(max=len(time) - 1)
        readings = plan.readings(time, generator)
        ids = np.array([k.node for k in marks], np.int64)
        curves.append(SimulatedCurve(time, readings, samples, ids, curve.boundary, curve.closed))
    return tuple(curves)


def exact_scan(shape: Shape, step: float) -> Scan:
    """The exact Darboux frames of a shape's curves, every segment sampled uniformly with about `step` m."""
    return Scan(tuple(_exact_curve(curve, step) for curve in shape.curves))


def _exact_curve(curve: ShapeCurve, step: float) -> CurveScan:
    ends = curve.node_positions
    counts = np.maximum(1, np.round(np.diff(ends) / step).astype(np.int64))
    samples = np.concatenate([[0], np.cumsum(counts)])
    distance = np.interp(np.arange(samples[-1] + 1), samples, ends)
    frames = curve.at(distance)[1]
    tangent, normal = frames[:, :, 0].copy(), frames[:, :, 1].copy()
    return CurveScan(distance, tangent, normal, samples, curve.node_ids, curve.boundary, curve.closed)


class _Motion:
    """Rows of a plan while it is made."""

    def __init__(self, handling: Handling) -> None:
        self._handling = handling
        self._rows: list[tuple[float, float, float, float, float, int]] = []
        self._keys: list[KeyPress] = []
        self._time = self._travelled = self._position = 0.0
        self._curve = 0

    def scan(self, index: int, curve: ShapeCurve, mark_errors: Floats) -> None:
        """Way to the curve, key, the curve with a pause and a key at each node, key."""
        stops = curve.node_positions + mark_errors
        self._curve, self._position = index, float(stops[0])
        self._wait(self._handling.lift)
        self._press("boundary" if curve.boundary else "interior")
        for number, stop in zip(curve.node_ids, stops, strict=True):
            self._travel(float(stop) - self._position)
            self._wait(self._handling.pause / 2)
            self._press("node", int(number))
            self._wait(self._handling.pause / 2)
        self._press("end")

    def plan(self, curves: Sequence[ShapeCurve], heading: Floats, imperfections: Imperfections) -> ScanPlan:
        self._row(0.0, 0.0)
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        time, travelled, position, speed, acceleration, curve = columns
        return ScanPlan(
            tuple(curves), time, travelled, position, speed, acceleration, curve,
            heading, tuple(self._keys), imperfections, self._handling,
        )  # fmt: skip

    def _row(self, speed: float, acceleration: float) -> None:
        self._rows.append((self._time, self._travelled, self._position, speed, acceleration, self._curve))

    def _press(self, key: Literal["boundary", "interior", "node", "end"], node: int | None = None) -> None:
        self._keys.append(KeyPress(self._time, key, node))

    def _wait(self, seconds: float) -> None:
        self._row(0.0, 0.0)
        self._time += seconds

    def _travel(self, distance: float) -> None:
        """Speed up, go on, slow down."""
        if distance <= 0:
            return
        a = self._handling.acceleration
        top = min(self._handling.speed, float(np.sqrt(a * distance)))
        ramp = top / a
        self._go(0.0, a, ramp)
        self._go(top, 0.0, distance / top - ramp)
        self._go(top, -a, ramp)

    def _go(self, speed: float, acceleration: float, seconds: float) -> None:
        self._row(speed, acceleration)
        moved = seconds * (speed + acceleration * seconds / 2)
        self._time += seconds
        self._travelled += moved
        self._position += moved


def _vectors(frames: Floats, heading: float) -> Floats:
    """What undisturbed sensors see: m = A^T e, with the magnetic field turned by `heading` about the vertical."""
    turned = exp(np.array([0.0, 0.0, heading])) @ REFERENCE_MAGNETIC
    return np.stack([e @ frames for e in (np.array(REFERENCE_ACCELERATION), turned)])


def _disturbed(vectors: Floats, imperfections: Imperfections, generator: np.random.Generator) -> Floats:
    """Noise on both vectors of a reading; an outlier spoils both."""
    noisy = vectors + generator.normal(0.0, imperfections.vector, vectors.shape)
    chance = generator.normal(size=vectors.shape)
    chance /= np.linalg.norm(chance, axis=2, keepdims=True)
    spoiled = generator.random((vectors.shape[1], 1)) < imperfections.outliers
    return np.where(spoiled, chance, noisy)


def _counts(vectors: Floats) -> Ints:
    return np.clip(np.round(vectors * (COUNTS / FULL_SCALE)), -COUNTS, COUNTS).astype(np.int64)


def _wrapped(turns: Ints) -> Ints:
    """The counter has 16 bits with a sign."""
    return (turns + 2**15) % 2**16 - 2**15
