"""Fixed arrays through the real server: recorded as sent, drawn while they move, reconstructed afterwards."""

import json
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from websockets.exceptions import ConnectionClosed

from tracemesh.geometry.simulated.moving_arrays import ARRAYS, MovingArray
from tracemesh.wire.live import LiveReading
from tracemesh_bridge.sources.virtual_array import declare, measure

Floats = NDArray[np.float64]


def device(moving: MovingArray) -> dict[str, Any]:
    return {"id": "a", "kind": "array", "array": declare(moving).model_dump()}


def sent(moving: MovingArray, times: list[float]) -> list[dict[str, Any]]:
    generator = np.random.default_rng(0)
    readings = (measure(moving, t, 0.0, generator) for t in times)
    return [{**r.model_dump(exclude_none=True), "seq": i} for i, r in enumerate(readings)]


def centred_nodes(moving: MovingArray, at: float) -> dict[int, Floats]:
    truth = moving.positions(at)
    return {int(n): truth[n] - truth.mean(axis=0) for n in moving.array.nodes}


def assert_is_truth(drawn: dict[str, Any], moving: MovingArray, within: float = 5e-3) -> None:
    reading = LiveReading.model_validate(drawn)
    truth = centred_nodes(moving, reading.time)
    assert [n.node for n in reading.nodes] == [*truth]
    for node in reading.nodes:
        assert node.position == pytest.approx(truth[node.node], abs=within)
    assert [c.index for c in reading.curves] == [*range(len(moving.array.curves))]


def record(ride: Any, session: str, moving: MovingArray, times: list[float], name: str = "r", **options: Any) -> Any:
    rider = ride(name, session, **options, **device(moving))
    for message in sent(moving, times):
        rider.send(message)
    rider.wait_for_ack(len(times) - 1)
    return rider


def test_readings_are_stored_as_sent_and_each_is_a_network(server: Any, ride: Any) -> None:
    session, moving = server.new_session(), ARRAYS["comb"]()
    rider = record(ride, session, moving, [0.0, 0.5, 1.25])
    lines = [rider.hello, *(json.dumps(m) for m in sent(moving, [0.0, 0.5, 1.25]))]
    assert server.http.get(f"/sessions/{session}/recordings/r").text == "\n".join(lines) + "\n"
    assert server.http.get(f"/sessions/{session}/readings").json() == {
        "count": 3, "first": 0, "times": [0.0, 0.5, 1.25],
    }  # fmt: skip
    page = server.http.get(f"/sessions/{session}/readings", params={"first": 1, "limit": 1}).json()
    assert page == {"count": 3, "first": 1, "times": [0.5]}
    for number in range(3):
        assert_is_truth(server.http.get(f"/sessions/{session}/readings/{number}").json(), moving)
    missing = server.http.get(f"/sessions/{session}/readings/3")
    assert (missing.status_code, missing.json()["detail"]) == (
        404, f"there is no reading 3 in session {session}: it has 3",
    )  # fmt: skip
    told = server.http.get(f"/sessions/{session}").json()
    assert (told["readings"], told["curves"], told["samples"]) == (3, 0, 0)


def test_readings_of_two_arrays_are_numbered_over_the_session(server: Any, ride: Any) -> None:
    session, one, two = server.new_session(), ARRAYS["ribbon"](), ARRAYS["comb"]()
    first = record(ride, session, one, [0.0], "one")
    record(ride, session, two, [0.3], "two")
    first.send({**sent(one, [0.7])[0], "seq": 1})
    first.wait_for_ack(1)
    drawn = [server.http.get(f"/sessions/{session}/readings/{n}").json() for n in range(3)]
    assert [d["recording"] for d in drawn] == ["one", "two", "one"]
    for one_drawn, moving in zip(drawn, (one, two, one), strict=True):
        assert_is_truth(one_drawn, moving)


def test_what_is_no_reading_of_the_array_is_refused(server: Any, ride: Any, line: Any) -> None:
    moving = ARRAYS["ribbon"]()
    good = sent(moving, [0.0])[0]
    cases = [
        ({**good, "acceleration": good["acceleration"][:7], "magnetic": good["magnetic"][:7]}, "wanted 8 sensors"),
        ({**good, "magnetic": good["magnetic"][:7]}, "columns of one length"),
        (line(3)[0], "wanted a reading from an array, got curve.start"),
    ]
    for number, (message, why) in enumerate(cases):
        rider = ride(f"bad{number}", server.new_session(), **device(moving))
        rider.send(message)
        answer = rider.receive()
        assert (answer["type"], answer["code"]) == ("error", "malformed")
        assert why in answer["message"]
    rider = ride("plain", server.new_session())
    rider.send(good)
    assert "whose hello has no array" in rider.receive()["message"]


def test_the_newest_reading_is_drawn(server: Any, ride: Any) -> None:
    session, moving = server.new_session(), ARRAYS["lattice"]()
    times = [n / 30 for n in range(60)]
    with server.connect(f"/sessions/{session}/live") as socket:
        rider = ride("r", session, **device(moving))
        for message in sent(moving, times):
            rider.send(message)
        seen = until(socket, lambda m: any(reading["number"] == 59 for reading in drawn_in(m)))
    drawn = [reading for message in seen for reading in drawn_in(message)]
    assert [reading["number"] for reading in drawn] == sorted(reading["number"] for reading in drawn)
    for message in (drawn[0], drawn[-1]):
        assert_is_truth(message, moving)
    with server.connect(f"/sessions/{session}/live") as late:
        seen = until(late, lambda m: bool(drawn_in(m)))
    assert drawn_in(seen[-1]) == drawn[-1:]


def drawn_in(message: dict[str, Any]) -> list[dict[str, Any]]:
    """Readings come as they are drawn, or with the state for who joins or falls behind."""
    if message["type"] == "live.snapshot":
        return list(message["readings"])
    return [message] if message["type"] == "live.reading" else []


def until(socket: Any, fits: Callable[[dict[str, Any]], bool]) -> list[dict[str, Any]]:
    seen: list[dict[str, Any]] = []
    while not seen or not fits(seen[-1]):
        seen.append(json.loads(socket.recv(timeout=60)))
    return seen


def test_a_reading_that_cannot_be_drawn_stops_nothing(server: Any, ride: Any) -> None:
    session, moving = server.new_session(), ARRAYS["ribbon"]()
    with server.connect(f"/sessions/{session}/live") as socket:
        rider = ride("r", session, **device(moving))
        rider.send({"type": "reading", "seq": 0, "time": 0.0, "quaternion": [[0.0, 0.0, 0.0, 0.0]] * 8})
        rider.wait_for_ack(0)
        rider.send({**sent(moving, [0.5])[0], "seq": 1})
        assert [reading["number"] for reading in drawn_in(until(socket, lambda m: bool(drawn_in(m)))[-1])] == [1]
    refused = server.http.get(f"/sessions/{session}/readings/0")
    assert refused.status_code == 422
    assert "quaternion 1 is zero" in refused.json()["detail"]


def test_a_reading_is_reconstructed(server: Any, ride: Any) -> None:
    session, moving = server.new_session(), ARRAYS["lattice"]()
    record(ride, session, moving, [0.0, 1.0])
    jobs = [
        server.http.post(f"/sessions/{session}/reconstructions", json={"step": "3%", **which}).json()["id"]
        for which in ({"reading": 0}, {})
    ]
    for job, at in zip(jobs, (0.0, 1.0), strict=True):
        while (state := server.http.get(f"/reconstructions/{job}").json())["state"] in ("queued", "running"):
            time.sleep(0.05)
        assert state["state"] == "done", state["error"]
        assert sorted(state["artifacts"]) == ["mesh.glb", "network.json", "report.json"]
        network = server.http.get(state["artifacts"]["network.json"].removeprefix("/api/v1")).json()
        nodes = np.array(network["points"])[network["nodes"]]
        assert nodes == pytest.approx(np.array([*centred_nodes(moving, at).values()]), abs=1e-3)
    preview = server.http.post(f"/sessions/{session}/preview", json={"reading": 1, "bend": 0.01}).json()
    assert (len(preview["curves"]), len(preview["nodes"])) == (16, 64)
    assert preview["report"]["parameters"]["bend_m"] == 0.01


def test_an_array_goes_through_an_archive(server: Any, ride: Any) -> None:
    session, moving = server.new_session(name="sheet"), ARRAYS["comb"]()
    record(ride, session, moving, [0.0, 0.5])
    archive = server.http.get(f"/sessions/{session}/archive").content
    again = server.http.post("/sessions/archive", content=archive).json()["id"]
    for path in ("readings", "readings/1", "recordings/r"):
        both = [server.http.get(f"/sessions/{s}/{path}").content for s in (session, again)]
        assert both[0] == both[1]
    assert server.http.delete(f"/sessions/{session}").status_code == 204


def test_a_killed_server_loses_no_acknowledged_reading(server_process: Any) -> None:
    server, moving = server_process.start(), ARRAYS["ribbon"]()
    session = server.new_session()
    messages = [json.dumps(m) for m in sent(moving, [n / 1000 for n in range(2000)])]
    hello = json.dumps({"type": "hello", "recording": "r", "session": session, "device": device(moving)})
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
    assert 50 < acknowledged < len(messages) - 1, "the server was killed too late to test anything"
    server = server_process.start()
    assert server.http.get(f"/sessions/{session}/readings").json()["count"] > acknowledged
    with server.connect("/ingest") as socket:
        socket.send(hello)
        next_seq = json.loads(socket.recv(timeout=60))["next_seq"]
        assert next_seq > acknowledged
        for text in messages[next_seq:]:
            socket.send(text)
        while json.loads(socket.recv(timeout=60))["seq"] < len(messages) - 1:
            pass
    assert server.http.get(f"/sessions/{session}/recordings/r").text == "\n".join([hello, *messages]) + "\n"
    assert server.http.get(f"/sessions/{session}/readings").json()["times"] == [n / 1000 for n in range(2000)]


def _send_all(socket: Any, messages: list[str]) -> None:
    try:
        for text in messages:
            socket.send(text)
            time.sleep(0.0005)
    except (ConnectionClosed, OSError):
        pass
