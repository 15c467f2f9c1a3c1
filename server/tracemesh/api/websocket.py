"""WebSockets for many devices: uvicorn's protocol, which stops reading a connection less often."""

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

MAX_WAITING = 8
"""Messages of one connection that wait for the application before no more are read."""


class SteadyReading(WebSocketsSansIOProtocol):
    """uvicorn stops reading after every message and begins again for the next one: two system calls each."""

    def send_receive_event_to_app(self) -> None:
        """Hand a complete message over; stop reading only when several wait."""
        paused, self.read_paused = self.read_paused, True  # or uvicorn would pause now
        super().send_receive_event_to_app()
        self.read_paused = paused
        if not paused and self.queue.qsize() >= MAX_WAITING:
            self.read_paused = True
            self.transport.pause_reading()
