"""The device protocol, over a real socket."""

import json
import random
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

Ride = Callable[..., Any]
Line = Callable[..., list[dict[str, Any]]]


def test_what_was_sent_comes_back_byte_for_byte(server: Any, ride: Ride, line: Line) -> None:
    session = server.new_session()
    rider = ride("exact", session)
    assert rider.welcome == {"type": "welcome", "version": 1, "session": session, "next_seq": 0}
    sent = [json.dumps(m, indent=None, separators=(", ", " : ")) for m in line(25)]
    for text in sent:
        rider.socket.send(text)
    rider.wait_for_ack(len(sent) - 1)
    exported = server.http.get(f"/sessions/{session}/recordings/exact")
    assert exported.text == "\n".join([rider.hello, *sent]) + "\n"
    (curve,) = server.http.get(f"/sessions/{session}/curves").json()
    assert (curve["samples"], curve["ended"], curve["length"]) == (25, True, pytest.approx(0.024))
    assert curve["marks"] == [{"sample": 0, "node": 0}, {"sample": 24, "node": 1}]


def test_a_device_without_a_session_gets_one_and_goes_on_with_it(server: Any, ride: Ride, line: Line) -> None:
    first = ride("own", name="blue rider")
    messages = line(30)
    for message in messages[:3]:
        first.send(message)
    first.wait_for_ack(2)
    first.socket.close()
    again = ride("own")
    assert again.welcome["session"] == first.welcome["session"]
    assert again.welcome["next_seq"] == 3
    assert server.http.get(f"/sessions/{first.welcome['session']}").json()["name"] == "blue rider"


def test_resent_and_shuffled_duplicates_change_nothing(server: Any, ride: Ride, line: Line) -> None:
    session = server.new_session()
    rider = ride("twice", session)
    messages = line(200)
    chance = random.Random(7)
    for done, message in enumerate(messages):
        rider.send(message)
        for again in chance.sample(messages[: done + 1], k=min(2, done + 1)):
            rider.send(again)
    rider.wait_for_ack(len(messages) - 1)
    lines = server.http.get(f"/sessions/{session}/recordings/twice").text.splitlines()
    assert [json.loads(text)["seq"] for text in lines[1:]] == list(range(len(messages)))
    assert server.http.get(f"/sessions/{session}").json()["samples"] == 200


def test_a_gap_is_named(server: Any, ride: Ride, line: Line) -> None:
    rider = ride("gap", server.new_session())
    messages = line(50)
    rider.send(messages[0])
    rider.send(messages[3])
    while (answer := rider.receive())["type"] == "ack":
        pass
    assert (answer["code"], answer["expected_seq"]) == ("gap", 1)


@pytest.mark.parametrize(
    ("message", "says"),
    [
        ({"type": "samples", "curve": 0, "seq": 0, "first_sample": 0, "distance": [0.0]}, "orientation"),
        ({"type": "node", "curve": 4, "seq": 0, "sample": 0, "node": 0}, "never started"),
        ({"type": "node", "curve": 4, "seq": -1, "sample": 0, "node": 0}, "greater than or equal to 0"),
        ({"type": "hello", "recording": "x", "device": {"id": "x", "kind": "x"}}, "second"),
        ({"type": "dance"}, "dance"),
    ],
)
def test_nonsense_is_refused_in_words(server: Any, ride: Ride, message: dict[str, Any], says: str) -> None:
    rider = ride("nonsense", server.new_session())
    rider.send(message)
    answer = rider.receive()
    assert answer["code"] == "malformed"
    assert says in answer["message"]


def test_samples_must_follow_each_other(server: Any, ride: Ride, line: Line) -> None:
    rider = ride("jump", server.new_session())
    start, block, *_ = line(10)
    rider.send(start)
    rider.send({**block, "first_sample": 5})
    while (answer := rider.receive())["type"] == "ack":
        pass
    assert "wanted first_sample 0, got 5" in answer["message"]


def test_version_and_session_are_checked_first(server: Any) -> None:
    device = {"id": "d", "kind": "k"}
    for hello, code in [
        ({"versions": [99], "recording": "r", "device": device}, "version"),
        ({"recording": "r", "session": "nowhere", "device": device}, "unknown"),
    ]:
        with server.connect("/ingest") as socket:
            socket.send(json.dumps({"type": "hello", **hello}))
            assert json.loads(socket.recv(timeout=60))["code"] == code


def test_limits(start_server: Callable[..., Any], ride: Ride, line: Line) -> None:
    small = start_server(max_session_bytes=2000, max_devices=1)
    rider = ride("much", small.new_session(), at=small)
    assert ride("second", at=small).welcome["code"] == "limit"
    for message in line(100):
        rider.send(message)
    while (answer := rider.receive())["type"] == "ack":
        pass
    assert answer["code"] == "limit"


def test_a_second_connection_takes_the_recording_over(server: Any, ride: Ride, line: Line) -> None:
    session = server.new_session()
    old = ride("moved", session)
    messages = line(40)
    for message in messages[:3]:
        old.send(message)
    old.wait_for_ack(2)
    new = ride("moved", session)
    assert new.welcome["next_seq"] == 3
    assert old.receive()["code"] == "limit"
    for message in messages[3:]:
        new.send(message)
    new.wait_for_ack(len(messages) - 1)


def test_two_devices_draw_into_one_session(server: Any, ride: Ride, line: Line) -> None:
    session = server.new_session()
    riders = [ride("left", session), ride("right", session)]
    messages = line(300)
    for message in messages:
        for rider in riders:
            rider.send(message)
    for rider in riders:
        rider.wait_for_ack(len(messages) - 1)
    curves = server.http.get(f"/sessions/{session}/curves").json()
    assert [c["index"] for c in curves] == [0, 1]
    assert {c["recording"] for c in curves} == {"left", "right"}
    assert [c["samples"] for c in curves] == [300, 300]


def test_marks_and_curves_are_taken_back(server: Any, ride: Ride, line: Line) -> None:
    session = server.new_session()
    rider = ride("undo", session)
    messages = line(20)
    messages.append({"type": "node", "curve": 0, "sample": 19, "node": 1, "undo": True})
    messages.append({"type": "node", "curve": 0, "sample": 19, "node": 8})
    messages += [{"type": "curve.start", "curve": 1}, {"type": "curve.end", "curve": 1, "discard": True}]
    for seq, message in enumerate(messages):
        rider.send({**message, "seq": seq})
    rider.wait_for_ack(len(messages) - 1)
    (curve,) = server.http.get(f"/sessions/{session}/curves").json()
    assert [m["node"] for m in curve["marks"]] == [0, 8]


def test_a_deleted_session_cuts_its_devices_off(server: Any, ride: Ride, line: Line) -> None:
    session = server.new_session()
    rider = ride("cut", session)
    with ThreadPoolExecutor(1) as background:
        deleted = background.submit(server.http.delete, f"/sessions/{session}")
        for message in line(2000, block=1):
            with suppress(
                ConnectionClosed
            ):  # it goes on sending: what comes after the deletion must not hide the reason
                rider.send(message)
        assert deleted.result().status_code == 204
    while (answer := rider.receive())["type"] == "ack":
        pass
    assert answer["code"] == "unknown"
    with pytest.raises(ConnectionClosed) as closed:
        rider.receive()
    assert closed.value.__cause__ is None, "the server read on until its close was answered"
    assert server.http.get(f"/sessions/{session}").status_code == 404


@pytest.mark.parametrize(
    "payload",
    [
        "",
        "null",
        "[" * 100_000,
        '{"type": "node", "seq": 1e999, "curve": 0, "sample": 0, "node": 0}',
        '{"type": "node", "seq": 99999999999999999999, "curve": 0, "sample": 0, "node": 0}',
        '{"type": "samples", "seq": 0, "curve": 0, "first_sample": 0, "distance": [NaN], "tangent": [[1, 0, 0]]}',
        '{"type":\n"node"}',
        b"\x00\xff\xfe",
    ],
)
def test_hostile_bytes_are_refused_and_nothing_else_happens(server: Any, ride: Ride, payload: str | bytes) -> None:
    session = server.new_session()
    rider = ride("hostile", session)
    rider.socket.send(payload)
    assert rider.receive()["code"] == "malformed"
    assert server.http.get(f"/sessions/{session}/recordings/hostile").text == rider.hello + "\n"
