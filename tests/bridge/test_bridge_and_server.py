"""The bridge and the real server, both killed while a curve is scanned: every sample is in the recording once."""

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request

import pytest

from tracemesh.wire.device import CurveEnd, Samples, from_device
from tracemesh_bridge.framing import Frame, FrameLayout, encode


class Server:
    """`tracemesh serve` on a port of its own."""

    def __init__(self, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"http://127.0.0.1:{self.port}"
        self._folder = folder
        self.start()

    def start(self):
        environment = {k: v for k, v in os.environ.items() if k != "TRACEMESH_TOKEN"}
        command = ["serve", "--port", str(self.port), "--data-dir", str(self._folder)]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tracemesh", *command],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment,
        )  # fmt: skip

    def kill(self):
        self._process.kill()
        self._process.wait()

    def get(self, path):
        with urllib.request.urlopen(f"{self.address}/api/v1{path}", timeout=30) as answer:
            return answer.read().decode()


@pytest.fixture
def real_server(bench):
    server = Server(bench.folder / "data")
    bench.server.port, port = server.port, bench.server.port
    yield server
    bench.server.port = port
    server.kill()


def frames(lines):
    return [
        encode(FrameLayout(), Frame(*row)).hex()
        for m in map(from_device.validate_json, lines)
        if isinstance(m, Samples)
        for row in zip(m.ticks, m.acceleration, m.magnetic, strict=True)
    ]


def test_server_and_bridge_killed_in_mid_curve(bench, real_server):
    bench.virtual()
    bridge = bench.bridge()
    bridge.says("server: live")
    bridge.says("device: live")
    bridge.type("-")
    bench.samples(150)
    real_server.kill()
    bridge.says("server: lost")
    bench.samples(150)
    bridge.stop(signal.SIGKILL)
    bridge = bench.bridge()
    bridge.says("device: live")
    bench.samples(150)
    real_server.start()
    bridge.says("server: live")
    bench.samples(50)
    bridge.type("*q")
    assert bridge.wait() == 0
    (session,) = json.loads(real_server.get("/sessions"))
    recordings = f"/sessions/{session['id']}/recordings"
    (recording,) = json.loads(real_server.get(recordings))
    stored = real_server.get(f"{recordings}/{recording['id']}").splitlines()
    places = [bench.sent().index(frame) for frame in frames(stored)]
    assert places == sorted(set(places))
    assert places[-1] - places[0] + 1 - len(places) <= 1, "only the answer on its way when the bridge was killed"
    end = from_device.validate_json(stored[-1])
    assert isinstance(end, CurveEnd)
    assert end.closed
