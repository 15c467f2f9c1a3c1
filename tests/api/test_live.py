"""What a browser sees, over a real socket."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracemesh.api.live.drawing import SPACING


def watch(socket: Any, until: Callable[[dict[str, Any]], bool], limit: int = 100) -> list[dict[str, Any]]:
    """Messages up to and including the first that fits."""
    seen: list[dict[str, Any]] = []
    for _ in range(limit):
        seen.append(json.loads(socket.recv(timeout=60)))
        if until(seen[-1]):
            return seen
    raise AssertionError([m["type"] for m in seen])


def drawn(messages: list[dict[str, Any]]) -> dict[int, list[float]]:
    """Positions of every curve after these messages, as a browser keeps them."""
    curves: dict[int, list[float]] = {}
    for message in messages:
        if message["type"] in ("live.snapshot", "live.network"):
            curves = {c["index"]: list(c["positions"]) for c in message["curves"]}
        elif message["type"] == "live.curve.start":
            curves[message["index"]] = []
        elif message["type"] == "live.points":
            assert len(curves[message["index"]]) == 3 * message["first"], "a point is missing or drawn twice"
            curves[message["index"]] += message["positions"]
    return curves


def is_type(name: str) -> Callable[[dict[str, Any]], bool]:
    return lambda message: message["type"] == name


def test_curves_grow_while_they_are_scanned(server: Any, ride: Any, line: Any) -> None:
    session = server.new_session()
    with server.connect(f"/sessions/{session}/live") as socket:
        assert watch(socket, is_type("live.snapshot"))[-1]["curves"] == []
        rider = ride("grow", session)
        for message in line(100):
            rider.send(message)
        seen = [{"type": "live.snapshot", "curves": []}, *watch(socket, is_type("live.curve.end"))]
        points = np.array(drawn(seen)[0]).reshape(-1, 3)
        assert points[:, 1:] == pytest.approx(0)
        assert np.all(np.diff(points[:, 0]) > 0)
        assert len(points) == 1 + round(0.099 / SPACING)
        assert points[0, 0] == 0
        assert 0.095 < points[-1, 0] < 0.0991
        nodes = [m["node"] for m in seen if m["type"] == "live.node"]
        assert [n["node"] for n in nodes] == [0, 1]


def test_everybody_hears_how_many_watch(server: Any) -> None:
    path = f"/sessions/{server.new_session()}/live"
    with server.connect(path) as first:
        assert watch(first, is_type("live.snapshot"))[-1]["watchers"] == 1
        with server.connect(path) as second:
            assert watch(second, is_type("live.snapshot"))[-1]["watchers"] == 2
            assert watch(first, is_type("live.watchers"))[-1]["count"] == 2
        assert watch(first, is_type("live.watchers"))[-1]["count"] == 1


def test_a_late_joiner_sees_what_an_early_one_sees(server: Any, ride: Any, line: Any) -> None:
    session = server.new_session()
    rider = ride("late", session)
    messages = line(300)
    half = len(messages) // 2
    for message in messages[:half]:
        rider.send(message)
    rider.wait_for_ack(half - 1)
    with server.connect(f"/sessions/{session}/live") as early:
        seen = watch(early, is_type("live.snapshot"))
        for message in messages[half:]:
            rider.send(message)
        seen += watch(early, is_type("live.curve.end"))
        with server.connect(f"/sessions/{session}/live") as late:
            snapshot = watch(late, is_type("live.snapshot"))
        assert drawn(seen) == drawn(snapshot)


def test_a_curve_starts_at_its_known_node(server: Any, ride: Any, line: Any) -> None:
    """The second curve begins at node 1, which is at the end of the first one."""
    session = server.new_session()
    with server.connect(f"/sessions/{session}/live") as socket:
        watch(socket, is_type("live.snapshot"))
        rider = ride("attach", session)
        first = line(100)
        second = [m for m in line(100, curve=1, first_seq=len(first)) if m["type"] != "node"]
        second.insert(2, {"type": "node", "curve": 1, "sample": 0, "node": 1})
        for seq, message in enumerate([*first, *second]):
            rider.send({**message, "seq": seq})
        seen = watch(socket, lambda m: m["type"] == "live.curve.end" and m["index"] == 1)
        curves = drawn(seen)
        assert curves[1][:3] == pytest.approx([0.099, 0, 0], abs=0.004)


def test_the_network_is_solved_while_it_is_scanned(server: Any, ride: Any, shared_data: Path) -> None:
    """A noisy scan of a cone, 1.2 m high, arrives as from a device; what is drawn in the end closes at its nodes."""
    session = server.new_session()
    donor = server.new_session()
    scan = (shared_data / "scans" / "cone-noisy.rawnet").read_bytes()
    recording = server.http.post(f"/sessions/{donor}/recordings", content=scan).json()["id"]
    messages = server.http.get(f"/sessions/{donor}/recordings/{recording}").text.splitlines()[1:]
    with server.connect(f"/sessions/{session}/live") as socket:
        rider = ride("cone", session)
        for text in messages:
            rider.socket.send(text)
        rider.wait_for_ack(len(messages) - 1)
        networks = watch(socket, lambda m: m["type"] == "live.network" and _closes(m), limit=400)
    curves = {c["index"]: np.array(c["positions"]).reshape(-1, 3) for c in networks[-1]["curves"]}
    assert len(curves) == 5
    apex = max(p[:, 2].max() for p in curves.values())
    base = min(p[:, 2].min() for p in curves.values())
    assert apex - base == pytest.approx(1.2, rel=0.02)


def _closes(network: dict[str, Any]) -> bool:
    """All five curves begin and end at nodes: dead reckoning alone never does."""
    nodes = np.array([node["position"] for node in network["nodes"]]).reshape(-1, 3)
    curves = [np.array(curve["positions"]).reshape(-1, 3) for curve in network["curves"]]
    if len(curves) < 5 or not len(nodes):
        return False
    ends = np.array([curve[k] for curve in curves for k in (0, -1)])
    return bool((np.linalg.norm(ends[:, None] - nodes, axis=2).min(axis=1) < 2e-5).all())


def test_edits_are_drawn(server: Any, ride: Any, line: Any) -> None:
    session = server.new_session()
    rider = ride("edit", session)
    messages = line(50)
    for message in messages:
        rider.send(message)
    rider.wait_for_ack(len(messages) - 1)
    with server.connect(f"/sessions/{session}/live") as socket:
        watch(socket, is_type("live.snapshot"))
        server.http.patch(f"/sessions/{session}/curves/0", json={"removed": True})
        assert watch(socket, is_type("live.snapshot"))[-1]["curves"] == []


def test_health_tells_who_measures(server: Any, ride: Any) -> None:
    session = server.new_session()
    rider = ride("healthy", session, name="blue", kind="phone")
    block = {"acceleration": [[0.0, 0.0, 9.81]] * 10, "magnetic": [[20.0, 0.0, -34.641]] * 10, "distance": [0.0] * 10}
    rider.send({"type": "curve.start", "seq": 0, "curve": 0})
    uneven = [0.01 * i + 0.002 * (i % 2) for i in range(10)]
    rider.send({"type": "samples", "seq": 1, "curve": 0, "first_sample": 0, "time": uneven, **block})
    rider.wait_for_ack(1)
    with server.connect(f"/sessions/{session}/live") as socket:
        device = watch(socket, is_type("live.device"))[-1]
        assert (device["recording"], device["kind"], device["name"], device["state"]) == (
            "healthy",
            "phone",
            "blue",
            "live",
        )
        assert device["acceleration_norm"] == pytest.approx(9.81)
        assert device["magnetic_norm"] == pytest.approx(40, rel=1e-3)
        assert device["dip"] == pytest.approx(np.pi / 3, rel=1e-3)
        assert device["jitter"] == pytest.approx(0.002, rel=0.1)
        rider.socket.close()
        assert watch(socket, lambda m: m["type"] == "live.device" and m["state"] == "lost")


def test_a_device_that_came_again_is_not_lost_with_its_old_connection(server: Any, ride: Any) -> None:
    session = server.new_session()
    old = ride("again", session)
    ride("again", session)
    with server.connect(f"/sessions/{session}/live") as socket:
        watch(socket, is_type("live.device"))
        assert old.receive()["code"] == "limit"
        old.socket.close()
        assert [m["state"] for m in watch(socket, is_type("live.device")) + watch(socket, is_type("live.device"))
                if m["type"] == "live.device"] == ["live", "live"]  # fmt: skip


def test_a_browser_that_does_not_read_delays_nobody(server: Any, ride: Any, line: Any) -> None:
    """Megabytes are drawn while one browser reads nothing; afterwards it gets the present state, not the backlog."""
    session = server.new_session()
    with server.connect(f"/sessions/{session}/live", max_queue=1, close_timeout=0.1) as sleepy:
        rider = ride("fast", session)
        messages = line(5000, block=500)
        for message in messages:
            rider.send(message)
        rider.wait_for_ack(len(messages) - 1)
        for _ in range(120):
            server.http.patch(f"/sessions/{session}/curves/0", json={"boundary": True})
        seen = watch(
            sleepy, lambda m: m["type"] == "live.snapshot" and bool(m["curves"]) and m["curves"][0]["boundary"]
        )
        assert len(seen) < 120


def test_an_unknown_session_is_told(server: Any) -> None:
    with server.connect("/sessions/nowhere/live") as socket, pytest.raises(Exception, match="4404"):
        socket.recv(timeout=60)


def test_whoever_joins_at_any_moment_misses_nothing(server: Any, ride: Any, line: Any) -> None:
    """Browsers join while a device sends without waiting for acknowledgements: all see the same curve in the end."""
    session = server.new_session()
    rider = ride("busy", session)
    messages = line(1200, block=5)
    joined = []
    with ExitStack() as stack:
        for number, message in enumerate(messages):
            rider.send(message)
            if number % 60 == 30:
                joined.append(stack.enter_context(server.connect(f"/sessions/{session}/live")))
        rider.wait_for_ack(len(messages) - 1)
        drawings = [drawn(_until_ended(socket)) for socket in joined]
    assert len(drawings) == 4
    assert drawings[0][0][-3] == pytest.approx(1.197, abs=0.0031)
    assert all(drawing == drawings[0] for drawing in drawings)


def _until_ended(socket: Any) -> list[dict[str, Any]]:
    """Everything up to the end of curve 0, whichever message says so."""
    return watch(
        socket,
        lambda m: m["type"] == "live.curve.end" or any(c["ended"] for c in m.get("curves", [])),
        limit=2000,
    )


def test_a_deleted_session_sends_its_watchers_away(server: Any) -> None:
    session = server.new_session()
    with server.connect(f"/sessions/{session}/live") as socket:
        watch(socket, is_type("live.snapshot"))
        server.http.delete(f"/sessions/{session}")
        with pytest.raises(Exception, match="1012"):
            watch(socket, lambda m: False)
    with server.connect(f"/sessions/{session}/live") as socket, pytest.raises(Exception, match="4404"):
        socket.recv(timeout=60)
