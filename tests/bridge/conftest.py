"""What the bridge is tested against: a server that can be told to misbehave, and the bridge's own processes.

The server speaks the device protocol over a real WebSocket; the device is a real pseudo-terminal in a process of its
own, and so is the bridge, because both must be killed.
"""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed

from tracemesh.wire.base import PROTOCOL_VERSION
from tracemesh.wire.device import Ack, ErrorMessage, Hello, Recorded, Samples, Welcome, from_device
from tracemesh_bridge.framing import Frame, FrameLayout, encode

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

    @property
    def messages(self) -> list[Recorded]:
        """The messages of the only recording."""
        (messages,) = self.stored.values() or [[]]
        return messages

    def frames(self, curve: int) -> list[str]:
        """The frames of a curve as the device sent them, in hex; fails if a sample is missing or there twice."""
        frames: list[str] = []
        for message in self.messages:
            if isinstance(message, Samples) and message.curve == curve:
                assert message.first_sample == len(frames)
                frames.extend(_frames(message))
        return frames

    async def handle(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        assert connection.request.path == "/api/v1/ingest"
        self.headers.append(connection.request.headers)
        with contextlib.suppress(ConnectionClosed):  # bridges are killed here
            await self._converse(connection)

    async def _converse(self, connection: ServerConnection) -> None:
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


def _frames(samples: Samples) -> list[str]:
    assert samples.ticks
    assert samples.acceleration
    assert samples.magnetic
    rows = zip(samples.ticks, samples.acceleration, samples.magnetic, strict=True)
    return [encode(FrameLayout(), Frame(*row)).hex() for row in rows]


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


def wait_until(condition: Callable[[], object], what: str = "") -> None:
    """Wait for something that must happen; no test is about how soon."""
    for _ in range(1500):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError(f"never happened: {what or condition}")


class Cable:
    """A TCP connection to a server that can be cut: both ends stay open, nothing comes through."""

    def __init__(self, port: int) -> None:
        self.cut = False
        self._to = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.address = f"http://127.0.0.1:{self.port}"
        self._ends: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        for end in (self._listening, *self._ends):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                try:
                    far = socket.create_connection(("127.0.0.1", self._to))
                except ConnectionRefusedError:  # nobody listens yet
                    near.close()
                    continue
                self._ends += [near, far]
                for a, b in ((near, far), (far, near)):
                    threading.Thread(target=self._carry, args=(a, b), daemon=True).start()

    def _carry(self, a: socket.socket, b: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := a.recv(65536):
                if not self.cut:
                    b.sendall(data)


PATIENT = ("--rate", "500", "--timeout", "2")
"""A busy computer is no fault of the device."""


class Process:
    """A tracemesh-bridge command, its keyboard a pipe, all it says kept."""

    def __init__(self, *arguments: str) -> None:
        environment = {**os.environ, "TRACEMESH_TOKEN": "secret", "PYTHONWARNINGS": "error"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tracemesh_bridge", *arguments],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment,
        )  # fmt: skip
        self.said = ""
        self.keys = b""
        self._listeners = [
            threading.Thread(target=self._listen, args=(stream, name))
            for stream, name in ((self._process.stderr, "said"), (self._process.stdout, "keys"))
        ]
        for listener in self._listeners:
            listener.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    def says(self, words: str) -> None:
        """Wait until it has said something."""
        wait_until(lambda: words in self.said or self._process.poll() is not None, words)
        assert words in self.said, self.said

    def type(self, keys: str) -> int:
        """Press keys; how many."""
        assert self._process.stdin is not None
        self._process.stdin.write(keys.encode())
        self._process.stdin.flush()
        return len(keys)

    def hang_up(self) -> None:
        """No more keys come."""
        assert self._process.stdin is not None
        self._process.stdin.close()

    def stop(self, number: int) -> int:
        """Send a signal and wait for the end."""
        if self._process.poll() is None:
            self._process.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        status = self._process.wait(60)
        for listener in self._listeners:
            listener.join()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            assert stream is not None
            with contextlib.suppress(BrokenPipeError):
                stream.close()
        return status

    def _listen(self, stream: "subprocess.IO[bytes]", name: str) -> None:
        for line in stream:
            setattr(self, name, getattr(self, name) + (line.decode() if name == "said" else line))


class Bench:
    """A virtual device, a server and bridges between them, in a folder of their own."""

    def __init__(self, folder: Path, server: RecordingServer) -> None:
        self.folder = folder
        self.server = server
        self._processes: list[Process] = []

    def virtual(self, *options: str) -> Process:
        link, log = str(self.folder / "rider"), str(self.folder / "log")
        device = self.start("virtual", "--link", link, "--log", log, "--pace", "request", *options)
        device.says("virtual Morphorider")
        return device

    def bridge(self, *options: str) -> Process:
        return self.recording("morphorider", "--port", str(self.folder / "rider*"), *PATIENT, *options)

    def recording(self, command: str, *options: str) -> Process:
        spool = str(self.folder / "spool")
        return self.start(command, "--spool", spool, "--server", self.server.address, *options)

    def sent(self) -> list[str]:
        """All whole frames that the device has sent, in hex."""
        log = self.folder / "log"
        return log.read_text().split() if log.exists() else []

    def samples(self, count: int) -> None:
        """Wait until the device has sent so many more frames."""
        wanted = len(self.sent()) + count
        try:
            wait_until(lambda: len(self.sent()) >= wanted, f"{count} more frames")
        except AssertionError as error:
            raise AssertionError("\n".join(p.said for p in self._processes)) from error

    def close(self) -> None:
        # Bridges before their devices: one left alone might take the next pseudo-terminal of that name.
        for process in reversed(self._processes):
            process.stop(9)

    def start(self, *arguments: str) -> Process:
        self._processes.append(Process(*arguments))
        return self._processes[-1]


@pytest.fixture
def eventually() -> Callable[[Callable[[], object]], None]:
    return wait_until


@pytest.fixture
def make_server() -> Callable[..., contextlib.AbstractContextManager[RecordingServer]]:
    """Starts another server, or the same one again."""
    return lambda server=None: running(server or RecordingServer())


@pytest.fixture
def server() -> Iterator[RecordingServer]:
    with running(RecordingServer()) as server:
        yield server


@pytest.fixture
def bench(tmp_path: Path, server: RecordingServer) -> Iterator[Bench]:
    bench = Bench(tmp_path, server)
    try:
        yield bench
    finally:
        bench.close()


@pytest.fixture
def new_cable() -> Iterator[Callable[[int], Cable]]:
    """Lays cables to ports."""
    with contextlib.ExitStack() as stack:
        yield lambda port: stack.enter_context(contextlib.closing(Cable(port)))
