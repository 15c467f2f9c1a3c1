"""WebSockets for many devices: uvicorn's protocol with a shorter way for messages that come all the time."""

from collections.abc import Callable, MutableMapping
from typing import Any

from uvicorn._types import ASGIReceiveEvent
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import InvalidState

MAX_WAITING = 8
"""Messages of one connection that wait for the application before no more are read."""
LINE = "tracemesh.line"
"""Name of the protocol among the extensions of a socket's scope."""


class SteadyReading(WebSocketsSansIOProtocol):
    """uvicorn stops reading after every message and begins again for the next one: two system calls each.

    A queue and a task that wakes up for each message cost as much as storing it: who listens gets it by a call.
    """

    _listener: Callable[[bytes], bool] | None = None
    _ready = False

    def listen(self, listener: Callable[[bytes], bool]) -> None:
        """Call `listener` with every message that comes while the application waits in `receive`.

        Once it returns False, messages queue for `receive` again until the application waits there anew.
        """
        self._listener = listener

    def send_now(self, text: str) -> bool:
        """Send without waiting; False where that cannot be."""
        if not self.writable.is_set() or self.close_sent or self.transport.is_closing():
            return False
        try:
            self.conn.send_text(text.encode())
        except InvalidState:
            return False
        self.transport.write(b"".join(self.conn.data_to_send()))
        return True

    async def run_asgi(self) -> None:
        """Let the application find this protocol."""
        self.scope["extensions"] = {**(self.scope["extensions"] or {}), LINE: {"protocol": self}}
        await super().run_asgi()

    async def receive(self) -> ASGIReceiveEvent:
        """The next message that nobody listened to."""
        self._ready = self.queue.empty()
        return await super().receive()

    def send_receive_event_to_app(self) -> None:
        """Hand a complete message over; stop reading only when several wait."""
        if self._listener is not None and self._ready and not self.close_sent:
            data, self.frames = b"".join(self.frames), []
            self._ready = self._listener(data)
            return
        self._ready = False
        paused, self.read_paused = self.read_paused, True  # or uvicorn would pause now
        super().send_receive_event_to_app()
        self.read_paused = paused
        if not paused and not self.close_sent and self.queue.qsize() >= MAX_WAITING:
            self.read_paused = True
            self.transport.pause_reading()


def line(scope: MutableMapping[str, Any]) -> SteadyReading:
    """The protocol of a socket."""
    protocol = scope["extensions"][LINE]["protocol"]
    assert isinstance(protocol, SteadyReading)
    return protocol
