"""How fast one device is read, so that it leaves room for the others."""

from collections.abc import Callable
from time import monotonic

BURST = 1.0
"""s worth of messages that may come at once."""
UNIT = 4096
"""Bytes of a message that count as one message more."""


class Pace:
    """Back-pressure in seconds: nothing is refused, only read later."""

    def __init__(self, rate: float, clock: Callable[[], float] = monotonic) -> None:
        """`rate`: messages a second."""
        self._rate = rate
        self._clock = clock
        self._due = clock()

    def take(self, size: int) -> float:
        """A message of `size` bytes was read: s to wait before the next one is."""
        now = self._clock()
        self._due = max(self._due, now - BURST) + (1 + size // UNIT) / self._rate
        return max(0.0, self._due - now)
