"""The bridge's own clock."""

import time


class Clock:
    """Seconds since 1970 UTC that never jump: the wall clock at the start plus what has passed since."""

    def __init__(self) -> None:
        """Starts now."""
        self._offset = time.time() - time.monotonic()

    def now(self) -> float:
        """Seconds since 1970 UTC, increasing even if somebody sets the computer's clock."""
        return self._offset + time.monotonic()
