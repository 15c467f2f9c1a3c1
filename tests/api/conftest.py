"""A real server in a thread of the test, and one in a process of its own that can be killed."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn
from websockets.sync.client import ClientConnection, connect

from tests.conftest import sockets_may_be_left
from tracemesh.api.server import configure
from tracemesh.settings import Settings

PATIENCE = 120.0
"""s that a server process gets to start."""


@dataclass
class RunningServer:
    """Where a server listens, and how to talk to it."""

    port: int
    token: str = ""
    pid: int = 0
    http: httpx.Client = field(init=False)

    def __post_init__(self) -> None:
        headers = {"Authorization": f"Bearer {self.token}"} if self.token else {}
        self.http = httpx.Client(base_url=f"http://127.0.0.1:{self.port}/api/v1", headers=headers, timeout=60)

    def connect(self, path: str, **options: Any) -> connect:
        own = {"max_size": None, "compression": None, "open_timeout": 60, **options}
        return connect(f"ws://127.0.0.1:{self.port}/api/v1{path}", **own)

    def new_session(self, **body: str) -> str:
        return str(self.http.post("/sessions", json=body).json()["id"])


class Rider:
    """A device on the ingest socket; `messages` are numbered when they are sent."""

    def __init__(self, socket: ClientConnection, recording: str, session: str | None, **device: Any) -> None:
        self.socket = socket
        body = {"id": "rider", "kind": "test", **device}
        self.hello = json.dumps({"type": "hello", "recording": recording, "session": session, "device": body})
        self.socket.send(self.hello)
        self.welcome = self.receive()

    def receive(self) -> dict[str, Any]:
        answer = json.loads(self.socket.recv(timeout=60))
        assert isinstance(answer, dict)
        return answer

    def send(self, message: dict[str, Any]) -> None:
        self.socket.send(json.dumps(message))

    def wait_for_ack(self, seq: int) -> None:
        while (answer := self.receive())["type"] == "ack" and answer["seq"] < seq:
            pass
        assert answer == {"type": "ack", "seq": seq}


def line_messages(samples: int, block: int = 10, curve: int = 0, first_seq: int = 0) -> list[dict[str, Any]]:
    """A straight ride along x, 1 mm a sample, nodes 0 and 1 at its ends."""
    messages: list[dict[str, Any]] = [{"type": "curve.start", "curve": curve}]
    for first in range(0, samples, block):
        count = min(block, samples - first)
        columns = {
            "distance": [0.001 * (first + i) for i in range(count)],
            "tangent": [[1.0, 0.0, 0.0]] * count,
            "normal": [[0.0, 0.0, 1.0]] * count,
        }
        messages.append({"type": "samples", "curve": curve, "first_sample": first, **columns})
    messages.append({"type": "node", "curve": curve, "sample": 0, "node": 0})
    messages.append({"type": "node", "curve": curve, "sample": samples - 1, "node": 1})
    messages.append({"type": "curve.end", "curve": curve})
    return [{**m, "seq": first_seq + i} for i, m in enumerate(messages)]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(scope="module", params=["sqlite", "postgresql"])
def database_kind(request: pytest.FixtureRequest) -> str:
    """All tests of the API run on each."""
    return str(request.param)


@pytest.fixture(scope="module")
def start_server(
    database_kind: str, new_database: Callable[[str], str], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., RunningServer]]:
    """Start a server in a thread, with settings of one's own; all are stopped after the module."""
    running: list[tuple[uvicorn.Server, threading.Thread, RunningServer]] = []

    def start(**options: Any) -> RunningServer:
        own = {"data_dir": tmp_path_factory.mktemp("data"), "port": free_port()}
        settings = Settings(**{"database_url": new_database(database_kind), **own, **options})
        server = uvicorn.Server(configure(settings))
        thread = threading.Thread(target=server.run)
        thread.start()
        while not server.started:
            assert thread.is_alive(), "the server did not start"
            time.sleep(0.01)
        token = settings.token.get_secret_value() if settings.token else ""
        running.append((server, thread, RunningServer(settings.port, token)))
        return running[-1][2]

    yield start
    with sockets_may_be_left():
        for server, thread, client in running:
            client.http.close()
            server.should_exit = True
            thread.join()
        running.clear()


@pytest.fixture(scope="module")
def server(start_server: Callable[..., RunningServer]) -> RunningServer:
    """A server with default settings, shared by the tests of a module."""
    return start_server()


@dataclass
class ServerProcess:
    """A server that can be killed and started again on the same data."""

    data_dir: Path
    database_url: str | None = None
    port: int = field(default_factory=free_port)
    process: subprocess.Popen[bytes] | None = None
    client: RunningServer | None = None

    def start(self, host: str = "127.0.0.1", **options: Any) -> RunningServer:
        command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(self.port), "--data-dir", self.data_dir]
        command += ["--host", host]
        database = {"TRACEMESH_DATABASE_URL": self.database_url} if self.database_url else {}
        self.process = subprocess.Popen(command, stderr=subprocess.DEVNULL, env={**os.environ, **database}, **options)
        self._hang_up()
        client = self.client = RunningServer(self.port, pid=self.process.pid)
        give_up = time.monotonic() + PATIENCE
        while time.monotonic() < give_up:
            assert self.process.poll() is None, "the server did not start"
            try:
                client.http.get(f"http://127.0.0.1:{self.port}/healthz", timeout=5)
            except httpx.TransportError:
                time.sleep(0.05)
            else:
                return client
        raise AssertionError(f"the server did not answer for {PATIENCE} s")

    def kill(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
        self._hang_up()

    def _hang_up(self) -> None:
        if self.client is not None:
            self.client.http.close()


@pytest.fixture(scope="module")
def start_processes() -> Iterator[Callable[..., list[RunningServer]]]:
    """Start several servers on one folder and database; all are killed after the module."""
    with ExitStack() as stack:

        def start(count: int, folder: Path, database_url: str) -> list[RunningServer]:
            processes = [ServerProcess(folder, database_url) for _ in range(count)]
            for process in processes:
                stack.callback(process.kill)
            return [process.start() for process in processes]

        yield start


@pytest.fixture
def plain_server_process(tmp_path: Path) -> Iterator[ServerProcess]:
    """A server in a process of its own, with the database that it makes itself."""
    process = ServerProcess(tmp_path)
    yield process
    process.kill()


@pytest.fixture
def server_process(tmp_path: Path, database_url: str) -> Iterator[ServerProcess]:
    """A server in a process of its own, on a database of each kind."""
    process = ServerProcess(tmp_path, database_url)
    yield process
    process.kill()


@pytest.fixture
def ride_at() -> Iterator[Callable[..., Rider]]:
    """Connect devices to a server; all hang up after the test."""
    with ExitStack() as stack:

        def begin(server: RunningServer, recording: str, session: str | None = None, **device: Any) -> Rider:
            return Rider(stack.enter_context(server.connect("/ingest")), recording, session, **device)

        yield begin


@pytest.fixture
def ride(server: RunningServer, ride_at: Callable[..., Rider]) -> Callable[..., Rider]:
    """Connect devices to the server of the test, or to another one."""

    def begin(recording: str, session: str | None = None, at: RunningServer | None = None, **device: Any) -> Rider:
        return ride_at(at or server, recording, session, **device)

    return begin


@pytest.fixture
def line() -> Callable[..., list[dict[str, Any]]]:
    """Messages of a straight ride."""
    return line_messages
