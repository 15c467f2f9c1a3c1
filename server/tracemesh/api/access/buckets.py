"""How often somebody may come."""

from collections.abc import Callable
from time import monotonic

MAX_KEYS = 10_000


class Buckets:
    """One bucket of permits for each key: full at first, filled at a constant rate."""

    def __init__(self, rate: float, burst: float, clock: Callable[[], float] = monotonic) -> None:
        """`rate` permits a second, `burst` at once at most; `clock` in s."""
        self._rate = rate
        self._burst = burst
        self._clock = clock
        self._levels: dict[str, tuple[float, float]] = {}

    def wait(self, key: str) -> float:
        """s until there is a permit for this key; 0 when there is one."""
        return max(0.0, (1.0 - self._level(key)) / self._rate)

    def take(self, key: str) -> None:
        """Use a permit, if there is one."""
        level = self._level(key)
        if len(self._levels) >= MAX_KEYS:
            self._forget_full()
        self._levels[key] = self._clock(), level - 1.0 if level >= 1.0 else level

    def _level(self, key: str) -> float:
        at, level = self._levels.get(key, (self._clock(), self._burst))
        return min(self._burst, level + self._rate * (self._clock() - at))

    def _forget_full(self) -> None:
        """A full bucket is as good as none; whoever floods with new keys makes the oldest ones forgotten."""
        kept = {key: entry for key, entry in self._levels.items() if self._level(key) < self._burst}
        self._levels = dict(list(kept.items())[-MAX_KEYS // 2 :])
