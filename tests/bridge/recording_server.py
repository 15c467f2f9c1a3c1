"""A small server that speaks the device protocol over a real WebSocket and can be told to misbehave."""

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers

from tracemesh.wire.base import PROTOCOL_VERSION
from tracemesh.wire.device import Ack, ErrorMessage, Hello, Recorded, Welcome, from_device

SESSION = "session-of-the-test"


@dataclass
class RecordingServer:
    """What came in, per recording, and the faults to inject.

    drop_after: close the connection after so many messages, once; silent: take messages, acknowledge nothing;
    refusal: answer every hello with this error; lose: take so many messages without storing them, then close.
    """

    port: int = 0
    hellos: list[Hello] = field(default_factory=list)
    headers: list[Headers] = field(default_factory=list)
    stored: dict[str, list[Recorded]] = field(default_factory=dict)
    lines: dict[str, list[str]] = field(default_factory=dict)
    drop_after: int | None = None
    lose: int = 0
    silent: bool = False
    refusal: ErrorMessage | None = None

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    async def handle(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        assert connection.request.path == "/api/v1/ingest"
        self.headers.append(connection.request.headers)
        hello = from_device.validate_json(await connection.recv())
        assert isinstance(hello, Hello)
        self.hellos.append(hello)
        if self.refusal:
            await connection.send(self.refusal.model_dump_json())
            return
        stored = self.stored.setdefault(hello.recording, [])
        welcome = Welcome(version=PROTOCOL_VERSION, session=hello.session or SESSION, next_seq=len(stored))
        await connection.send(welcome.model_dump_json())
        async for line in connection:
            if not await self._take(connection, hello.recording, str(line)):
                return

    async def _take(self, connection: ServerConnection, recording: str, line: str) -> bool:
        message = from_device.validate_json(line)
        assert not isinstance(message, Hello)
        stored = self.stored[recording]
        if self.lose:
            self.lose -= 1
            return self.lose > 0
        if message.seq > len(stored):
            error = ErrorMessage(code="gap", message=f"got {message.seq}", expected_seq=len(stored))
            await connection.send(error.model_dump_json())
            return False
        if message.seq == len(stored):
            stored.append(message)
            self.lines.setdefault(recording, []).append(line)
        if self.drop_after is not None and len(stored) >= self.drop_after:
            self.drop_after = None
            return False
        if not self.silent:
            await connection.send(Ack(seq=message.seq).model_dump_json())
        return True


@contextlib.contextmanager
def running(server: RecordingServer) -> Iterator[RecordingServer]:
    """The server in a thread of its own, on a free port or the one it had before."""
    loop = asyncio.new_event_loop()
    ready = threading.Event()
    stop = asyncio.Event()

    async def main() -> None:
        async with serve(server.handle, "127.0.0.1", server.port, compression=None, close_timeout=0.1) as listening:
            server.port = listening.sockets[0].getsockname()[1]
            ready.set()
            await stop.wait()

    thread = threading.Thread(target=loop.run_until_complete, args=(main(),))
    thread.start()
    assert ready.wait(10), "the test's server did not start"
    try:
        yield server
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join()
        loop.close()
