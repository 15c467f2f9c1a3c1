"""One browser that watches: a short queue; whoever falls behind gets the present state instead of a backlog."""

import asyncio
from collections import deque

MAX_QUEUE = 128
"""Messages that wait for one browser; two seconds at sixty a second."""


class Client:
    """Never waits for its browser and never holds more than MAX_QUEUE messages."""

    def __init__(self) -> None:
        """A client that needs the present state first."""
        self.behind = True
        self.ended = False
        self._queue: deque[str] = deque()
        self._wake = asyncio.Event()
        self._wake.set()

    def push(self, text: str) -> None:
        """Queue a message, or drop everything in favour of a new snapshot."""
        if self.behind:
            return
        self._queue.append(text)
        if len(self._queue) > MAX_QUEUE:
            self.need_snapshot()
        self._wake.set()

    def need_snapshot(self) -> None:
        """What is queued does not matter any more."""
        self._queue.clear()
        self.behind = True
        self._wake.set()

    def end(self) -> None:
        """There is nothing more to come: the browser should connect again."""
        self.ended = True
        self._wake.set()

    async def wait(self) -> None:
        """Until there is something to send."""
        await self._wake.wait()
        self._wake.clear()

    def pop(self) -> str | None:
        """The next message, if any."""
        return self._queue.popleft() if self._queue else None
