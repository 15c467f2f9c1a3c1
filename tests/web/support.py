"""The server, the device and the eyes of the browser tests."""

import base64
import json
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Locator
from websockets.sync.client import ClientConnection

from tracemesh.formats.recordings import Recording
from tracemesh.wire.device import Samples

PATIENCE = 120.0
"""s until a test gives up waiting."""
BLOCK = 60
"""Samples in one message: one second of a Morphorider."""


@dataclass(frozen=True)
class Server:
    """A `tracemesh serve` process."""

    address: str
    process: subprocess.Popen[bytes]

    def await_health(self) -> None:
        """Wait until it answers."""
        give_up = time.monotonic() + PATIENCE
        while time.monotonic() < give_up:
            assert self.process.poll() is None, "the server stopped"
            try:
                urllib.request.urlopen(f"http://{self.address}/healthz", timeout=1).close()
            except OSError:
                time.sleep(0.05)
            else:
                return
        raise AssertionError("the server did not answer")

    def call(self, method: str, path: str, body: object = None) -> Any:
        """JSON of a REST answer."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"http://{self.address}/api/v1{path}", data, method=method)
        request.add_header("content-type", "application/json")
        with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
            return json.load(answer)

    def upload(self, session: str, recording: str) -> None:
        """Take in a recording as a file."""
        address = f"http://{self.address}/api/v1/sessions/{session}/recordings"
        urllib.request.urlopen(urllib.request.Request(address, recording.encode()), timeout=PATIENCE).close()

    def page(self, fragment: str = "") -> str:
        """Address of a page."""
        return f"http://{self.address}/{fragment}"


@contextmanager
def running_server(data: Path, port: int) -> Iterator[Server]:
    """A server process on this port and data folder, still starting; killed without warning at the end."""
    command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(port), "--data-dir", str(data)]
    with (data / "server.log").open("a") as log, subprocess.Popen(command, stderr=log) as process:
        try:
            yield Server(f"127.0.0.1:{port}", process)
        finally:
            process.kill()


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Rider:
    """A simulated Morphorider on the ingest socket; waits until what it sent is durable."""

    def __init__(self, connection: ClientConnection, recording: Recording) -> None:
        self._connection = connection
        self._messages = [m.model_dump(mode="json", exclude_none=True) for m in _in_blocks(recording)]
        self._next = 0
        self._tell(recording.hello.model_dump(mode="json", exclude_none=True))
        assert self._hear()["type"] == "welcome"

    def ride(self, until: Callable[[dict[str, Any]], bool]) -> None:
        """Send messages up to and including the first for which `until` holds."""
        while True:
            message = self._messages[self._next] | {"seq": self._next}
            self._tell(message)
            self._next += 1
            if until(message) or self._next == len(self._messages):
                break
        while self._hear()["seq"] < self._next - 1:
            pass

    def _tell(self, message: dict[str, Any]) -> None:
        self._connection.send(json.dumps(message))

    def _hear(self) -> dict[str, Any]:
        answer = json.loads(self._connection.recv(timeout=PATIENCE))
        assert isinstance(answer, dict)
        assert answer["type"] != "error", answer
        return answer


def _in_blocks(recording: Recording) -> Iterator[Any]:
    for message in recording.messages:
        if not isinstance(message, Samples):
            yield message
            continue
        for first in range(0, message.count, BLOCK):
            columns = {name: column[first : first + BLOCK] for name, column in message.columns().items()}
            yield message.model_copy(update={**columns, "first_sample": message.first_sample + first})


COUNT_PIXELS = """async ([picture, tokens]) => {
  const rgb = (css) => {
    const probe = document.createElement("i");
    probe.style.color = css;
    document.body.append(probe);
    const values = getComputedStyle(probe).color.match(/\\d+/g).map(Number);
    probe.remove();
    return values;
  };
  const style = getComputedStyle(document.documentElement);
  const wanted = tokens.map((token) => rgb(style.getPropertyValue("--" + token)));
  const bitmap = await createImageBitmap(await (await fetch("data:image/png;base64," + picture)).blob());
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
  const near = ([r, g, b], i) => Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b) < 24;
  const counts = wanted.map(() => 0);
  for (let i = 0; i < data.length; i += 4) wanted.forEach((color, k) => (counts[k] += near(color, i) ? 1 : 0));
  return counts.map((count) => (4 * count) / data.length);
}"""


def share_of_pixels(view: Locator, *tokens: str) -> list[float]:
    """Which part of a picture of `view` has each of these colours (design tokens)."""
    picture = base64.b64encode(view.screenshot()).decode()
    shares = view.page.evaluate(COUNT_PIXELS, [picture, list(tokens)])
    assert isinstance(shares, list)
    return shares
