"""Device, bridge and server as they run in a lab; bridge and server are killed in mid-curve and started again."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tracemesh.formats.recordings import read_recording
from tracemesh.wire.device import CurveEnd, NodeMark, Samples
from tracemesh_bridge.framing import Frame, FrameLayout, encode


class Lab:
    """The three processes, in a folder of their own. The ride goes on by one reading per request of the bridge."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = _free_port()
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._logs = (folder / "messages.txt").open("ab")
        self._start("device", "tracemesh_bridge", "virtual", "--link", folder / "rider", "--pace", "request")
        self.start_server()
        self.until(self._is_up, "the server is up")
        self._request("POST", "/sessions", json.dumps({"id": "lab"}).encode())

    def start_server(self) -> None:
        self._start("server", "tracemesh", "serve", "--port", self.port, "--data-dir", self.folder / "data")

    def start_bridge(self) -> None:
        address = ("--server", f"http://127.0.0.1:{self.port}", "--session", "lab", "--spool", self.folder / "spool")
        self._start(
            "bridge", "tracemesh_bridge", "morphorider", "--port", self.folder / "rider", "--rate", 400, *address
        )
        self.until(lambda: b"device: live" in self.messages()[self._said :], "the device is live")

    def kill(self, name: str) -> None:
        self._processes[name].kill()
        self._processes[name].wait()

    def press(self, keys: str) -> None:
        pipe = self._processes["bridge"].stdin
        assert pipe is not None
        pipe.write(keys.encode())
        pipe.flush()

    def wait_for_frames(self, count: int) -> None:
        wanted = len(self.frames()) + count
        self.until(lambda: len(self.frames()) >= wanted, f"{count} more frames")

    def frames(self) -> list[str]:
        """Every whole frame that the device has sent, in hex."""
        log = self.folder / "frames"
        return log.read_text().split() if log.exists() else []

    def messages(self) -> bytes:
        return (self.folder / "messages.txt").read_bytes()

    def get(self, path: str) -> str:
        return self._request("GET", f"/sessions/lab{path}")

    def _request(self, method: str, path: str, body: bytes | None = None) -> str:
        url, headers = f"http://127.0.0.1:{self.port}/api/v1{path}", {"Content-Type": "application/json"}
        request = urllib.request.Request(url, body, headers, method=method)
        with urllib.request.urlopen(request, timeout=20) as answer:
            text: str = answer.read().decode()
            return text

    def _is_up(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def until(self, condition: Callable[[], object], what: str) -> None:
        for _ in range(2000):
            if condition():
                return
            time.sleep(0.02)
        raise AssertionError(f"never happened: {what}\n{self.messages().decode()}")

    def wait_for_bridge(self) -> int:
        return self._processes["bridge"].wait(60)

    def close(self) -> None:
        for process in reversed(
            self._processes.values()
        ):  # the bridge before its device, whose terminal may be given away
            process.send_signal(signal.SIGKILL)
            process.wait()
            if process.stdin:
                process.stdin.close()
        self._logs.close()

    def _start(self, name: str, module: str, command: str, *options: object) -> None:
        self._said = len(self.messages())
        log = ("--log", self.folder / "frames") if name == "device" else ()
        words = [sys.executable, "-m", module, command, *map(str, (*options, *log))]
        environment = {**os.environ, "PYTHONWARNINGS": "error"}
        old = self._processes.pop(name, None)
        if old is not None and old.stdin:
            old.stdin.close()
        self._processes[name] = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=self._logs, env=environment
        )


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    lab = Lab(tmp_path)
    try:
        yield lab
    finally:
        lab.close()


def stored_frames(recording: str) -> list[str]:
    """What the server has of the only curve, as the device sent it; fails when a sample is missing or there twice."""
    frames: list[str] = []
    for message in read_recording(recording.splitlines()).messages:
        if isinstance(message, Samples):
            assert message.curve == 0
            assert message.first_sample == len(frames)
            assert message.ticks
            assert message.acceleration
            assert message.magnetic
            rows = zip(message.ticks, message.acceleration, message.magnetic, strict=True)
            frames += [encode(FrameLayout(), Frame(*row)).hex() for row in rows]
    return frames


def missing(part: list[str], whole: list[str]) -> int:
    """How many of the frames between the first and the last stored one are not stored; fails if order changed."""
    places, start = [], 0
    for frame in part:
        start = whole.index(frame, start) + 1
        places.append(start)
    return places[-1] - places[0] + 1 - len(places)


@pytest.mark.parametrize("killed", ["bridge", "server"])
def test_a_process_killed_in_mid_curve_loses_no_sample(lab: Lab, killed: str) -> None:
    lab.start_bridge()
    lab.press("-0\n")
    for _ in range(2):
        lab.wait_for_frames(150)
        lab.kill(killed)
        if killed == "server":
            lab.wait_for_frames(100)
            lab.start_server()
        else:
            lab.start_bridge()
    lab.wait_for_frames(100)
    lab.press("1\n.q")
    assert lab.wait_for_bridge() == 0
    (summary,) = json.loads(lab.get("/recordings"))
    recording = lab.get(f"/recordings/{summary['id']}")
    stored = stored_frames(recording)
    assert len(stored) >= 400
    answers_on_their_way = 2 if killed == "bridge" else 0  # asked for by a bridge that died before they came
    assert missing(stored, lab.frames()) <= answers_on_their_way
    messages = read_recording(recording.splitlines()).messages
    assert [m.node for m in messages if isinstance(m, NodeMark)] == [0, 1]
    assert isinstance(messages[-1], CurveEnd)
