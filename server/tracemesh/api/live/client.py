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
        self._queue: deque[tuple[str, str]] = deque()
        self._wake = asyncio.Event()
        self._wake.set()

    def push(self, text: str, replaces: str = "") -> None:
        """Queue a message, or drop everything in favour of a new snapshot.

        `replaces`: what the message is the newest of; an older one that still waits is not sent any more.
        """
        if self.behind:
            return
        if replaces:
            self._queue = deque(waiting for waiting in self._queue if waiting[0] != replaces)
        self._queue.append((replaces, text))
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
        return self._queue.popleft()[1] if self._queue else None
