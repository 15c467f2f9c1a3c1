"""kill -9 at the worst moments: what was acknowledged is there afterwards, and the work goes on."""

import json
import resource
import signal
import threading
import time
from contextlib import nullcontext
from datetime import datetime, timedelta, tzinfo
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from tests.jobs.support import origins, until, wait_for_end, workers
from tracemesh.storage import models


def test_nothing_acknowledged_is_lost_and_the_device_goes_on(server_process: Any, line: Any) -> None:
    server = server_process.start()
    session = server.new_session()
    messages = [json.dumps(m) for m in line(4000, block=2)]
    hello = _hello(session)
    acknowledged = _send_until_killed(server_process, server, hello, messages)
    assert 0 <= acknowledged < len(messages) - 1, "the server was killed too late to test anything"
    server = server_process.start()
    _send_the_rest(server, hello, messages, acknowledged)
    assert server.http.get(f"/sessions/{session}/recordings/r").text == "\n".join([hello, *messages]) + "\n"
    assert server.http.get(f"/sessions/{session}").json()["samples"] == 4000


def _send_until_killed(server_process: Any, server: Any, hello: str, messages: list[str]) -> int:
    """The last acknowledged number when the server dies under a device that never stops sending."""
    acknowledged = -1
    with server.connect("/ingest") as socket:
        socket.send(hello)
        socket.recv(timeout=60)
        sender = threading.Thread(target=_send_all, args=(socket, messages))
        sender.start()
        try:
            while True:
                acknowledged = json.loads(socket.recv(timeout=60))["seq"]
                if acknowledged > 50:
                    server_process.kill()
        except (ConnectionClosed, OSError):
            pass
        sender.join()
    return acknowledged


def _send_all(socket: Any, messages: list[str]) -> None:
    try:
        for text in messages:
            socket.send(text)
            time.sleep(0.0005)
    except (ConnectionClosed, OSError):
        pass


def test_a_job_of_a_killed_server_ends_with_it_and_is_taken_up(server_process: Any, shared_data: Path) -> None:
    server = server_process.start()
    session = server.new_session()
    scan = (shared_data / "scans" / "cone-noisy.rawnet").read_bytes()
    server.http.post(f"/sessions/{session}/recordings", content=scan)
    job = server.http.post(f"/sessions/{session}/reconstructions").json()["id"]
    until(lambda: server.http.get(f"/reconstructions/{job}").json()["fraction"] > 0)
    processes = origins(server.pid) + workers(server.pid)
    assert len(processes) > 1
    server_process.kill()
    wait_for_end(processes)
    server = server_process.start()
    done = _wait(server, job)
    assert (done["state"], sorted(done["artifacts"])) == ("done", ["mesh.glb", "network.json", "report.json"])


def test_a_graceful_stop_commits_what_was_accepted(server_process: Any, line: Any) -> None:
    server = server_process.start()
    session = server.new_session()
    messages = [json.dumps(m) for m in line(500)]
    with server.connect("/ingest") as socket:
        socket.send(_hello(session))
        socket.recv(timeout=60)
        for text in messages:
            socket.send(text)
        server_process.process.send_signal(signal.SIGTERM)
        acknowledged = -1
        with pytest.raises(ConnectionClosed):
            while True:
                acknowledged = json.loads(socket.recv(timeout=60))["seq"]
    server_process.process.wait(20)
    server = server_process.start()
    assert server.http.get(f"/sessions/{session}/recordings/r").text.count("\n") - 2 >= acknowledged


@pytest.mark.usefixtures("torn_connections")
def test_a_full_disk_is_told_and_nothing_acknowledged_is_lost(
    server_process: Any, line: Any, request: pytest.FixtureRequest
) -> None:
    """No file of the database may grow beyond a size: it meets the same error as on a full disk."""
    on_postgresql = server_process.database_url.startswith("postgresql")
    messages = [json.dumps(m) for m in line(24_000 if on_postgresql else 6_000)]  # several times what has room
    with request.getfixturevalue("postgresql").no_file_beyond(1_200_000) if on_postgresql else nullcontext():
        server = server_process.start(preexec_fn=None if on_postgresql else _small_files)
        session = server.new_session()
        hello = _hello(session)
        acknowledged, refusal = _send_until_refused(server, hello, messages)
        assert refusal["code"] == "storage"
        assert 0 < acknowledged < len(messages) - 1
        assert server.http.get(f"/sessions/{session}").status_code == 200, "reading still works"
    server_process.kill()
    server = server_process.start()
    _send_the_rest(server, hello, messages, acknowledged)
    assert server.http.get(f"/sessions/{session}/recordings/r").text == "\n".join([hello, *messages]) + "\n"


def _send_until_refused(server: Any, hello: str, messages: list[str]) -> tuple[int, dict[str, Any]]:
    """The last acknowledged number, and what the server says when it can take no more."""
    acknowledged = -1
    with server.connect("/ingest") as socket:
        socket.send(hello)
        socket.recv(timeout=60)
        sender = threading.Thread(target=_send_all, args=(socket, messages))
        sender.start()
        while (answer := json.loads(socket.recv(timeout=60)))["type"] == "ack":
            acknowledged = answer["seq"]
        sender.join()
    return acknowledged, answer


def _send_the_rest(server: Any, hello: str, messages: list[str], acknowledged: int) -> None:
    """As a device does that was cut off: from where the server wants it."""
    with server.connect("/ingest") as socket:
        socket.send(hello)
        next_seq = json.loads(socket.recv(timeout=60))["next_seq"]
        assert next_seq > acknowledged
        for text in messages[next_seq:]:
            socket.send(text)
        while json.loads(socket.recv(timeout=60))["seq"] < len(messages) - 1:
            pass


def _hello(session: str) -> str:
    return json.dumps({"type": "hello", "recording": "r", "session": session, "device": {"id": "d", "kind": "test"}})


@pytest.mark.usefixtures("torn_connections")
@pytest.mark.parametrize("database_kind", ["postgresql"], indirect=True)
def test_postgresql_crashes_under_a_device(start_server: Any, postgresql: Any, line: Any) -> None:
    """The device is told or cut off, connects again as a bridge does, and everything is there once and in order."""
    server = start_server()
    session = server.new_session()
    messages = [json.dumps(m) for m in line(3000, block=10)]
    hello = _hello(session)
    acknowledged, crashes = -1, 0
    while acknowledged < len(messages) - 1:
        with server.connect("/ingest") as socket:
            socket.send(hello)
            answer = json.loads(socket.recv(timeout=60))
            for text in messages[answer.get("next_seq", len(messages)) :]:
                try:
                    socket.send(text)
                    answer = json.loads(socket.recv(timeout=60))
                except ConnectionClosed:
                    break
                acknowledged = answer.get("seq", acknowledged)
                if acknowledged > 100 and crashes < 2:
                    postgresql.crash()
                    crashes += 1
    assert crashes == 2
    assert server.http.get(f"/sessions/{session}/recordings/r").text == "\n".join([hello, *messages]) + "\n"


def test_a_clock_that_is_set_back_loses_nothing(
    start_server: Any, ride_at: Any, line: Any, shared_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Recordings go on and stay in order, jobs end; only the times themselves tell of it."""
    server = start_server()
    session = server.new_session()
    messages = line(100)
    rider = ride_at(server, "first", session)
    for message in messages[:6]:
        rider.send(message)
    rider.wait_for_ack(5)
    monkeypatch.setattr(models, "datetime", _AnHourAgo)
    for name, begin in (("first", 6), ("second", 0)):
        rider = ride_at(server, name, session)
        assert rider.welcome["next_seq"] == begin
        for message in messages[begin:]:
            rider.send(message)
        rider.wait_for_ack(len(messages) - 1)
        stored = server.http.get(f"/sessions/{session}/recordings/{name}").text.splitlines()[1:]
        assert [json.loads(text) for text in stored] == messages
    first, second = server.http.get(f"/sessions/{session}/recordings").json()
    assert (first["id"], second["id"]) == ("first", "second")
    assert second["created"] < first["created"]
    scanned = server.new_session()
    scan = (shared_data / "scans" / "cone-noisy.rawnet").read_bytes()
    server.http.post(f"/sessions/{scanned}/recordings", content=scan)
    quick = {"step": "6%", "surface": False}
    job = _wait(server, server.http.post(f"/sessions/{scanned}/reconstructions", json=quick).json()["id"])
    assert (job["state"], job["created"] < first["created"]) == ("done", True)


class _AnHourAgo:
    @staticmethod
    def now(zone: tzinfo) -> datetime:
        return datetime.now(zone) - timedelta(hours=1)


def _small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))


def _wait(server: Any, job: str) -> Any:
    while (state := server.http.get(f"/reconstructions/{job}").json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    return state
