"""How well a device does: what the operator sees beside the counts."""

import math
import statistics
import threading
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from tracemesh.wire.base import Vector
from tracemesh_bridge.clock import Clock
from tracemesh_bridge.source import Link, Reading

WINDOW_SECONDS = 2.0


class Health:
    """Rate, jitter, age, lag, field strengths and dip over the last two seconds, and all faults.

    Sources tell it from their threads, the operator's line is made in another: a lock keeps them apart.
    """

    def __init__(self) -> None:
        """Nothing received yet."""
        self.received = 0
        self._faults: Counter[str] = Counter()
        self._recent: deque[Reading] = deque()
        self._lock = threading.Lock()

    def take(self, reading: Reading) -> None:
        """Take one reading into account."""
        with self._lock:
            self.received += 1
            self._recent.append(reading)
            while self._recent[0].received < reading.received - WINDOW_SECONDS:
                self._recent.popleft()

    def fault(self, kind: str, count: int = 1) -> None:
        """Count something that went wrong: late, short, surplus, implausible, ..."""
        with self._lock:
            self._faults[kind] += count

    @property
    def faults(self) -> Counter[str]:
        """How often each kind of fault has happened so far."""
        with self._lock:
            return self._faults.copy()

    @property
    def recent(self) -> list[Reading]:
        """The readings of the last two seconds."""
        with self._lock:
            return list(self._recent)

    @property
    def lag(self) -> float | None:
        """s that the newest reading took longer than the quickest one lately; None if the device has no clock.

        Two clocks differ by an offset nobody knows; the smallest (arrival - device time) is it, plus the quickest way.
        """
        delays = [r.received - r.time for r in self.recent if r.time is not None]
        return delays[-1] - min(delays) if delays else None

    def rate(self, now: float) -> float:
        """Readings per second over the last two seconds."""
        return sum(r.received > now - WINDOW_SECONDS for r in self.recent) / WINDOW_SECONDS

    def describe(self, now: float) -> str:
        """One line for the operator."""
        recent, lag = self.recent, self.lag
        if not recent:
            return "no sample yet"
        parts = [f"{self.rate(now):.1f} Hz", f"jitter {1000 * _jitter(recent):.1f} ms"]
        parts.append(f"age {now - recent[-1].received:.1f} s")
        parts.extend([] if lag is None else [f"lag {1000 * lag:.0f} ms"])
        parts.extend(_field(recent))
        parts.extend(f"{count} {kind}" for kind, count in sorted(self.faults.items()))
        return "  ".join(parts)


@dataclass(frozen=True)
class Host:
    """What a source is given by the bridge: whom to tell how the connection and the readings do, and the time."""

    link: Link
    health: Health = field(default_factory=Health)
    clock: Clock = field(default_factory=Clock)


def dip(acceleration: Vector, magnetic: Vector) -> float:
    """Angle of the field below the horizontal, rad, from two vectors measured at rest, any units, not 0."""
    up, field = math.hypot(*acceleration), math.hypot(*magnetic)
    cosine = sum(a / up * (m / field) for a, m in zip(acceleration, magnetic, strict=True))
    return math.asin(max(-1.0, min(1.0, -cosine)))


def _jitter(recent: Sequence[Reading]) -> float:
    """Standard deviation of the time between readings, s; by the device's clock if it has one."""
    times = [r.received if r.time is None else r.time for r in recent]
    gaps = [b - a for a, b in pairwise(times)]
    return statistics.pstdev(gaps) if len(gaps) > 1 else 0.0


def _field(recent: Sequence[Reading]) -> list[str]:
    pairs = [
        (r.acceleration, r.magnetic)
        for r in recent
        if r.acceleration is not None and r.magnetic is not None and any(r.acceleration) and any(r.magnetic)
    ]
    if not pairs:
        return []
    return [
        f"|acc| {_mean([math.hypot(*a) for a, _ in pairs]):.3g}",
        f"|mag| {_mean([math.hypot(*m) for _, m in pairs]):.3g}",
        f"dip {math.degrees(_mean([dip(a, m) for a, m in pairs])):.1f}°",
    ]


def _mean(values: Sequence[float]) -> float:
    """Also of values whose sum is more than a float holds, as a device that is out of order may send them."""
    return math.fsum(value / len(values) for value in values)
