"""Two server processes on one PostgreSQL: it does not matter at which one a device or a browser is."""

import json
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed


@pytest.fixture(scope="module")
def team(
    start_processes: Callable[..., list[Any]], new_database: Callable[[str], str], tmp_path_factory: Any
) -> list[Any]:
    """Two servers that share a database and a folder."""
    return start_processes(2, tmp_path_factory.mktemp("team"), new_database("postgresql"))


@pytest.fixture
def watch() -> Iterator[Callable[..., Callable[..., list[dict[str, Any]]]]]:
    """Watch a session at a server; what is returned reads until a message fulfils a condition."""
    with ExitStack() as stack:

        def begin(server: Any, session: str) -> Callable[..., list[dict[str, Any]]]:
            socket = stack.enter_context(server.connect(f"/sessions/{session}/live"))

            def until(condition: Callable[[dict[str, Any]], bool]) -> list[dict[str, Any]]:
                seen = [json.loads(socket.recv(timeout=60))]
                while not condition(seen[-1]):
                    seen.append(json.loads(socket.recv(timeout=60)))
                return seen

            until(lambda m: m["type"] == "live.snapshot")
            return until

        yield begin


def deliver(servers: list[Any], session: str, recording: str, messages: list[dict[str, Any]], **of_device: Any) -> int:
    """Send a recording as a bridge does, at another server whenever a connection ends; how many it took."""
    device = {"id": "d", "kind": "test", **of_device}
    hello = {"type": "hello", "recording": recording, "session": session, "device": device}
    acknowledged, attempt = -1, 0
    while acknowledged < len(messages) - 1:
        with suppress(ConnectionClosed, OSError), servers[attempt % len(servers)].connect("/ingest") as socket:
            socket.send(json.dumps(hello))
            answer = json.loads(socket.recv(timeout=60))
            for message in messages[answer.get("next_seq", len(messages)) :]:
                socket.send(json.dumps(message))
            while answer["type"] != "error" and acknowledged < len(messages) - 1:
                answer = json.loads(socket.recv(timeout=60))
                acknowledged = answer.get("seq", acknowledged)
        attempt += 1
        time.sleep(0.05)
    return attempt


def rides(line: Any, curves: int) -> list[dict[str, Any]]:
    """Several short curves, one after another, numbered on."""
    messages: list[dict[str, Any]] = []
    for curve in range(curves):
        messages += line(20, curve=curve, first_seq=len(messages))
    return messages


def stored(server: Any, session: str, recording: str) -> list[dict[str, Any]]:
    lines = server.http.get(f"/sessions/{session}/recordings/{recording}").text.splitlines()
    return [json.loads(text) for text in lines[1:]]


def test_what_is_recorded_at_one_server_is_seen_at_the_other(team: Any, line: Any, ride_at: Any, watch: Any) -> None:
    here, there = team
    session = here.new_session()
    views = [watch(here, session), watch(there, session)]
    rider = ride_at(here, "seen", session)
    messages = line(300)
    for message in messages:
        rider.send(message)
    rider.wait_for_ack(len(messages) - 1)
    seen = [view(lambda m: m["type"] == "live.curve.end") for view in views]
    drawn = [
        {m["first"] + i: m["positions"][3 * i : 3 * i + 3] for m in messages if m["type"] == "live.points"
         for i in range(len(m["positions"]) // 3)}
        for messages in seen
    ]  # fmt: skip
    assert len(drawn[0]) == 100
    assert drawn[0] == drawn[1]
    views[1](lambda m: m["type"] == "live.device" and m["recording"] == "seen" and m["state"] != "lost")
    rider.socket.close()
    views[1](lambda m: m["type"] == "live.device" and m["recording"] == "seen" and m["state"] == "lost")


def test_edits_and_progress_at_one_server_are_seen_at_the_other(team: Any, line: Any, watch: Any) -> None:
    here, there = team
    session = here.new_session()
    deliver([here], session, "edited", line(50))
    view = watch(there, session)
    here.http.patch(f"/sessions/{session}/curves/0", json={"boundary": True})
    (edited,) = view(lambda m: m["type"] == "live.snapshot")[-1]["curves"]
    assert edited["boundary"]
    job = here.http.post(f"/sessions/{session}/reconstructions").json()["id"]

    def is_its_end(message: dict[str, Any]) -> bool:
        ours = message["type"] == "live.reconstruction" and message["reconstruction"]["id"] == job
        return ours and message["reconstruction"]["state"] not in ("queued", "running")

    view(is_its_end)
    assert here.http.delete(f"/sessions/{session}").status_code == 204
    with pytest.raises(ConnectionClosed):
        view(lambda m: False)


@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_devices_at_both_servers_draw_into_one_session(
    kind: str, start_processes: Any, new_database: Any, tmp_path: Path, line: Any
) -> None:
    """No two curves or readings get one number, whoever counts; all is stored once and in order, on SQLite too.

    A new curve may take its device another connection; readings are too many for that."""
    team = start_processes(2, tmp_path, new_database(kind))
    session = team[0].new_session()
    messages = rides(line, 15)
    readings = [{"type": "reading", "seq": n, "time": n / 50, "quaternion": [[1, 0, 0, 0]] * 2} for n in range(300)]
    ribbon = {"curves": [{"sensors": [0, 1], "spacing": [0.1]}]}
    with ThreadPoolExecutor(4) as devices:
        sent = [devices.submit(deliver, [server], session, f"at-{server.port}", messages) for server in team]
        read = [
            devices.submit(deliver, [server], session, f"array-{server.port}", readings, array=ribbon)
            for server in team
        ]
        for one in sent:
            one.result()
        assert [one.result() for one in read] == [1, 1]
    curves = team[0].http.get(f"/sessions/{session}/curves").json()
    assert sorted(c["index"] for c in curves) == list(range(30))
    assert all(c["samples"] == 20 for c in curves)
    for server in team:
        assert stored(team[0], session, f"at-{server.port}") == messages
        assert stored(team[0], session, f"array-{server.port}") == readings
    counted = team[1].http.get(f"/sessions/{session}/readings", params={"limit": 1000}).json()
    assert counted["count"] == 600
    assert sorted(counted["times"]) == sorted(2 * [reading["time"] for reading in readings])


def test_a_device_may_go_on_at_the_other_server(team: Any, line: Any, ride_at: Any) -> None:
    """Its first connection may live on, half open: what comes over it now is not taken."""
    here, there = team
    session = here.new_session()
    messages = line(200)
    old = ride_at(here, "moved", session)
    for message in messages[:5]:
        old.send(message)
    old.wait_for_ack(4)
    new = ride_at(there, "moved", session)
    assert new.welcome["next_seq"] == 5
    old.send(messages[5])
    answer = old.receive()
    assert (answer["type"], answer["code"]) == ("error", "limit")
    for message in messages[5:]:
        new.send(message)
    new.wait_for_ack(len(messages) - 1)
    assert stored(here, session, "moved") == messages


def test_postgresql_crashes_under_two_servers_and_their_devices(team: Any, postgresql: Any, line: Any) -> None:
    session = team[0].new_session()
    messages = line(2000, block=5)
    with ThreadPoolExecutor(4) as devices:
        sent = [devices.submit(deliver, [team[i % 2]], session, f"r{i}", messages) for i in range(4)]
        for samples in (500, 3000):
            while (now := team[0].http.get(f"/sessions/{session}")).is_error or now.json()["samples"] < samples:
                pass
            postgresql.crash()
        for one in sent:
            one.result()
    for i in range(4):
        assert stored(team[0], session, f"r{i}") == messages


def test_a_device_whose_server_is_killed_goes_on_at_the_other(
    start_processes: Any, new_database: Any, tmp_path: Path, line: Any
) -> None:
    team = start_processes(2, tmp_path, new_database("postgresql"))
    session = team[0].new_session()
    messages = line(3000, block=5)
    with ThreadPoolExecutor(1) as device:
        sent = device.submit(deliver, team, session, "r", messages)
        while team[1].http.get(f"/sessions/{session}").json()["samples"] < 100:
            pass
        os.kill(team[0].pid, 9)
        sent.result()
    assert stored(team[1], session, "r") == messages
