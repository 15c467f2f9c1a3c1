"""How well a device does: what the operator sees beside the counts."""

import math
from collections import Counter, deque
from dataclasses import dataclass, field
from itertools import pairwise

from tracemesh.wire.base import Vector
from tracemesh_bridge.clock import Clock
from tracemesh_bridge.source import Link, Reading

WINDOW_SECONDS = 2.0


class Health:
    """Rate, jitter, age, field strengths, dip, clock offset and faults over the last two seconds."""

    def __init__(self) -> None:
        """Nothing received yet."""
        self.faults: Counter[str] = Counter()
        self.received = 0
        self._recent: deque[Reading] = deque()

    def take(self, reading: Reading) -> None:
        """Take one reading into account."""
        self.received += 1
        self._recent.append(reading)
        while self._recent[0].received < reading.received - WINDOW_SECONDS:
            self._recent.popleft()

    @property
    def lag(self) -> float | None:
        """s that the newest reading took longer than the quickest one lately; None if the device has no clock.

        Two clocks differ by an offset nobody knows; the smallest (arrival - device time) is it, plus the quickest way.
        """
        delays = [r.received - r.time for r in self._recent if r.time is not None]
        return delays[-1] - min(delays) if delays else None

    def fault(self, kind: str) -> None:
        """Count something that went wrong: late, short, surplus, implausible, ..."""
        self.faults[kind] += 1

    def rate(self, now: float) -> float:
        """Readings per second over the last two seconds."""
        return sum(r.received > now - WINDOW_SECONDS for r in self._recent) / WINDOW_SECONDS

    def describe(self, now: float) -> str:
        """One line for the operator."""
        if not self._recent:
            return "no sample yet"
        parts = [f"{self.rate(now):.1f} Hz", f"jitter {1000 * self._jitter():.1f} ms"]
        parts.append(f"age {now - self._recent[-1].received:.1f} s")
        parts.extend([] if self.lag is None else [f"lag {1000 * self.lag:.0f} ms"])
        parts.extend(self._field())
        parts.extend(f"{count} {kind}" for kind, count in sorted(self.faults.items()))
        return "  ".join(parts)

    def _jitter(self) -> float:
        times = [r.received if r.time is None else r.time for r in self._recent]
        gaps = [b - a for a, b in pairwise(times)]
        if len(gaps) < 2:
            return 0.0
        mean = sum(gaps) / len(gaps)
        return math.sqrt(sum((g - mean) ** 2 for g in gaps) / len(gaps))

    def _field(self) -> list[str]:
        pairs = [
            (r.acceleration, r.magnetic)
            for r in self._recent
            if r.acceleration is not None and r.magnetic is not None and any(r.acceleration) and any(r.magnetic)
        ]
        if not pairs:
            return []
        dips = [dip(a, m) for a, m in pairs]
        return [
            f"|acc| {sum(math.hypot(*a) for a, _ in pairs) / len(pairs):.3g}",
            f"|mag| {sum(math.hypot(*m) for _, m in pairs) / len(pairs):.3g}",
            f"dip {math.degrees(sum(dips) / len(dips)):.1f}°",
        ]


@dataclass(frozen=True)
class Host:
    """What a source is given by the bridge: whom to tell how the connection and the readings do, and the time."""

    link: Link
    health: Health = field(default_factory=Health)
    clock: Clock = field(default_factory=Clock)


def dip(acceleration: Vector, magnetic: Vector) -> float:
    """Angle of the field below the horizontal, rad, from the two vectors a device measures at rest (any units)."""
    norm = math.hypot(*acceleration) * math.hypot(*magnetic)
    cosine = sum(a * m for a, m in zip(acceleration, magnetic, strict=True)) / norm
    return math.asin(max(-1.0, min(1.0, -cosine)))
