"""The bridge and the real server, both killed while a curve is scanned: every sample is in the recording once."""

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import numpy as np
import pytest

from tracemesh.formats.calibrations import corrections
from tracemesh.wire.calibration import Calibration
from tracemesh.wire.device import CurveEnd, Device, Samples, from_device
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

    def fill_disk(self):
        """From now on no byte can be written; returns what makes room again."""
        before = resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE, (1, before[1]))
        return lambda: resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE, before)

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


def only_recording(server):
    (session,) = json.loads(server.get("/sessions"))
    recordings = f"/sessions/{session['id']}/recordings"
    (recording,) = json.loads(server.get(recordings))
    return server.get(f"{recordings}/{recording['id']}").splitlines()


def assert_stored_whole(bench, server, samples):
    """At least so many samples are in the only recording: in the device's order, each once, none left out."""
    sent, stored = bench.sent(), frames(only_recording(server))
    assert len(stored) >= samples
    first = sent.index(stored[0])
    assert stored == sent[first : first + len(stored)]


def test_a_full_disk_at_the_server_costs_nothing(bench, real_server, eventually):
    bench.virtual()
    bridge = bench.bridge()
    bridge.says("server: live")
    bridge.says("device: live")
    bridge.type("-")
    bench.samples(50)
    make_room = real_server.fill_disk()
    bridge.says("cannot store messages now")
    bench.samples(100)
    make_room()
    eventually(lambda: bridge.said.count("server: live") == 2)
    bench.samples(50)
    bridge.type("*q")
    assert bridge.wait() == 0
    assert_stored_whole(bench, real_server, 200)


def test_a_network_that_is_cut_for_a_minute_is_told_once_and_costs_nothing(bench, real_server, new_cable, eventually):
    """Both ends stay open, nothing comes through: what a cut network looks like. For a minute in real time: both sides
    miss pings, the server gives the connection up, and the pauses between attempts grow to their longest."""
    cable = new_cable(real_server.port)
    bench.server.port = cable.port
    bench.virtual()
    bridge = bench.bridge("--rate", "50")
    bridge.says("server: live")
    bridge.says("device: live")
    bridge.type("-")
    bench.samples(50)
    cable.cut, since, already = True, time.monotonic(), len(bench.sent())
    while time.monotonic() < since + 60:
        bench.samples(50)
    assert "server: searching" in bridge.said
    cable.cut, meanwhile = False, len(bench.sent()) - already
    eventually(lambda: bridge.said.count("server: live") == 2)
    bench.samples(20)
    bridge.type("*q")
    assert bridge.wait() == 0
    assert bridge.said.count("server: stale") == 1
    assert_stored_whole(bench, real_server, 70 + meanwhile)


def test_server_and_bridge_killed_in_mid_curve(bench, real_server):
    bench.virtual()
    bridge = bench.bridge()
    bridge.says("server: live")
    bridge.says("device: live")
    bridge.type("-")
    bench.samples(40)
    real_server.kill()
    bridge.says("server: lost")
    bench.samples(40)
    bridge.stop(signal.SIGKILL)
    bridge = bench.bridge()
    bridge.says("device: live")
    bench.samples(40)
    real_server.start()
    bridge.says("server: live")
    bench.samples(20)
    bridge.type("*q")
    assert bridge.wait() == 0
    stored = only_recording(real_server)
    places = [bench.sent().index(frame) for frame in frames(stored)]
    assert places == sorted(set(places))
    assert places[-1] - places[0] + 1 - len(places) <= 1, "only the answer on its way when the bridge was killed"
    end = from_device.validate_json(stored[-1])
    assert isinstance(end, CurveEnd)
    assert end.closed


SENSORS = {"coverage": 1, "spread_before": 0, "spread_after": 0}
TRUE = {
    "device": "morphorider",
    "made": "2026-05-03T10:00:00Z",
    "circumference": 0.097,
    "accelerometer": {"matrix": [[0.98, 0.01, 0], [0.01, 1.02, 0], [0, 0, 1]], "offset": [0.01, -0.015, 0.005]}
    | SENSORS,
    "magnetometer": {"matrix": [[0.87, -0.05, 0], [-0.05, 1.1, 0.03], [0, 0.03, 1.05]], "offset": [0.12, -0.08, 0.05]}
    | SENSORS,
    "alignment": [0.99964, 0.02, -0.015, 0.01],
}


def directions(calibration):
    """What a calibrated device measures in three poses, each vector of length 1."""
    device = Device(id="morphorider", kind="k", calibration=Calibration.model_validate(calibration))
    right = corrections(device)["magnetic"](0.3 * np.eye(3))
    return right / np.linalg.norm(right, axis=1, keepdims=True)


def test_a_virtual_device_that_errs_is_calibrated_and_recorded_with_its_calibration(bench, real_server, eventually):
    true, found = bench.folder / "true.json", bench.folder / "found.json"
    true.write_text(json.dumps(TRUE))
    port = ("--port", str(bench.folder / "rider"), "--rate", "500", "--timeout", "2")
    device = bench.virtual("--calibrating", "--distortion", str(true), "--noise", "0.5")
    command = bench.start(
        "calibrate", *port, "--place", "the lab", "--output", str(found), "--server", real_server.address
    )
    for step in range(1, 5):
        eventually(lambda step=step: device.keys.count(b"\n") >= step)
        command.type("\n")
    assert command.wait() == 0, command.said
    calibration = json.loads(found.read_text())
    assert calibration["circumference"] == pytest.approx(0.097, rel=0.002)
    np.testing.assert_allclose(calibration["magnetometer"]["offset"], TRUE["magnetometer"]["offset"], atol=0.002)
    np.testing.assert_allclose(calibration["accelerometer"]["matrix"], TRUE["accelerometer"]["matrix"], atol=0.02)
    np.testing.assert_allclose(directions(calibration), directions(TRUE), atol=0.02)
    assert calibration["accelerometer"]["spread_before"] > 2 * calibration["accelerometer"]["spread_after"]
    assert json.loads(real_server.get("/devices/morphorider/calibrations")) == [{**calibration, "version": 1}]

    device.wait()
    bench.virtual()
    plain = bench.bridge()
    plain.says("calibration 1 of morphorider")
    plain.stop(signal.SIGINT)
    chosen = bench.bridge("--calibration", str(found))
    chosen.says("server: live")
    assert "is available" not in chosen.said
    (session,) = (s["id"] for s in json.loads(real_server.get("/sessions"))[:1])
    (recording,) = json.loads(real_server.get(f"/sessions/{session}/recordings"))
    assert recording["calibration"] == 1
