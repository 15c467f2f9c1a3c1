"""Health of a device that records: rate, jitter, age, strength and dip of what it measures."""

from collections import deque
from time import monotonic

import numpy as np

from tracemesh.geometry.scan import Floats
from tracemesh.geometry.sensing.orientation import angles_between
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Hello, Samples
from tracemesh.wire.live import LiveDevice

STALE_AFTER = 2.0
"""s without a sample."""
WINDOW = 1.0
"""s over which the rate is measured."""


class Meter:
    """Counts samples as they arrive; reads their values only when asked."""

    def __init__(self, hello: Hello, is_here: bool = True) -> None:
        """Nothing arrived yet; `is_here`: the device is connected to this server, not to another one."""
        self.is_here = is_here
        self._hello = hello
        self._began = self._last = monotonic()
        self._arrivals: deque[tuple[float, int]] = deque()
        self._block: Samples | ArrayReading | None = None
        self.connected = True

    def add(self, block: Samples | ArrayReading) -> None:
        """A block of samples, or one reading of an array, arrived now."""
        self._last = monotonic()
        self._arrivals.append((self._last, block.count if isinstance(block, Samples) else 1))
        self._forget(self._last - WINDOW)
        self._block = block

    def _forget(self, before: float) -> None:
        while self._arrivals and self._arrivals[0][0] <= before:
            self._arrivals.popleft()

    def read(self) -> LiveDevice:
        """Health now."""
        now = monotonic()
        age = now - self._last
        self._forget(now - WINDOW)
        recent = sum(count for _, count in self._arrivals)
        acceleration, magnetic = self._vectors()
        return LiveDevice(
            recording=self._hello.recording,
            kind=self._hello.device.kind,
            name=self._hello.device.name,
            state="lost" if not self.connected else "stale" if age > STALE_AFTER else "live",
            rate=recent / min(WINDOW, max(now - self._began, 0.1)),
            age=age,
            jitter=_jitter(self._block),
            acceleration_norm=_mean_norm(acceleration),
            magnetic_norm=_mean_norm(magnetic),
            dip=_dip(acceleration, magnetic),
        )

    def _vectors(self) -> tuple[Floats | None, Floats | None]:
        if self._block is None:
            return None, None
        columns = self._block.acceleration, self._block.magnetic
        acceleration, magnetic = (None if column is None else np.array(column, float) for column in columns)
        return acceleration, magnetic


def _jitter(block: Samples | ArrayReading | None) -> float | None:
    """By the device's clock if it has one; a single reading tells nothing."""
    if not isinstance(block, Samples):
        return None
    times = block.received if block.time is None else block.time
    return None if times is None or len(times) < 3 else float(np.std(np.diff(times)))


def _mean_norm(vectors: Floats | None) -> float | None:
    return None if vectors is None else float(np.mean(np.linalg.norm(vectors, axis=1)))


def _dip(acceleration: Floats | None, magnetic: Floats | None) -> float | None:
    """Angle of the field below the horizontal; acceleration points up at rest."""
    if acceleration is None or magnetic is None:
        return None
    return float(np.mean(angles_between(acceleration, magnetic))) - np.pi / 2
