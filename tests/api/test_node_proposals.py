"""Nodes that were found, over HTTP."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracemesh.formats.rawnet import read_rawnet


@pytest.fixture
def session(server: Any, shared_data: Path) -> str:
    """A session with a noisy scan as its operator marked it."""
    made: str = server.new_session()
    scan = (shared_data / "scans/sphere-noisy.rawnet").read_bytes()
    server.http.post(f"/sessions/{made}/recordings", content=scan).raise_for_status()
    return made


def places(node: dict[str, Any]) -> list[tuple[int, int]]:
    return [(p["curve"], p["sample"]) for p in node["places"]]


def operators_marks(server: Any, session: str) -> dict[int, list[tuple[int, int]]]:
    """Places of every node as marked; the end of a closed curve is its beginning."""
    found: dict[int, list[tuple[int, int]]] = {}
    for curve in server.http.get(f"/sessions/{session}/curves").json():
        for mark in curve["marks"][: -1 if curve["closed"] else None]:
            found.setdefault(mark["node"], []).append((curve["index"], mark["sample"]))
    return found


def set_marks(server: Any, session: str, nodes: dict[int, list[tuple[int, int]]]) -> None:
    for curve in server.http.get(f"/sessions/{session}/curves").json():
        marks = sorted((s, n) for n, at in nodes.items() for i, s in at if i == curve["index"])
        body = {"marks": [{"sample": s, "node": n} for s, n in marks]}
        server.http.patch(f"/sessions/{session}/curves/{curve['index']}", json=body).raise_for_status()


class Truth:
    """The operator's marks as places along curves."""

    def __init__(self, server: Any, session: str, shared_data: Path) -> None:
        scan = read_rawnet((shared_data / "scans/sphere-noisy.rawnet").read_text())
        self.curves = scan.curves
        self.nodes = operators_marks(server, session)

    def nodes_at(self, proposal: dict[str, Any], tolerance: float) -> list[int]:
        """Nodes on the same curves within `tolerance` m along each."""
        return [n for n, at in self.nodes.items() if self._agree(sorted(places(proposal)), sorted(at), tolerance)]

    def _agree(self, one: list[tuple[int, int]], other: list[tuple[int, int]], tolerance: float) -> bool:
        return [c for c, _ in one] == [c for c, _ in other] and all(
            self._apart(c, s, t) < tolerance for (c, s), (_, t) in zip(one, other, strict=True)
        )

    def _apart(self, curve: int, one: int, other: int) -> float:
        distance = self.curves[curve].distance
        apart = abs(float(distance[one] - distance[other]))
        return min(apart, float(np.ptp(distance)) - apart) if self.curves[curve].closed else apart


def test_marks_taken_away_are_proposed_again_and_accepted_they_make_a_network(
    server: Any, session: str, shared_data: Path
) -> None:
    truth = Truth(server, session, shared_data)
    set_marks(server, session, {})
    answer = server.http.get(f"/sessions/{session}/node-proposals").json()
    assert answer["unplaced"] == []
    found = [truth.nodes_at(proposal, 0.02) for proposal in answer["proposals"]]
    assert sorted(found) == sorted([n] for n in truth.nodes)
    assert all(p["confidence"] > 0.9 and p["node"] is None for p in answer["proposals"])
    assert server.http.post(f"/sessions/{session}/preview").status_code == 422
    set_marks(server, session, {n: places(p) for n, p in enumerate(answer["proposals"])})
    preview = server.http.post(f"/sessions/{session}/preview").json()
    assert len(preview["nodes"]) == len(truth.nodes)


def test_samples_are_those_that_were_sent_though_a_closed_curve_is_first_marked_in_its_middle(
    server: Any, session: str, shared_data: Path
) -> None:
    truth = Truth(server, session, shared_data)
    closed = next(c for c in server.http.get(f"/sessions/{session}/curves").json() if c["closed"])["index"]
    middle = len(truth.curves[closed].distance) // 3
    node = next(n for n, at in truth.nodes.items() if any(c == closed and s > middle for c, s in at))
    set_marks(server, session, {node: truth.nodes[node]})
    proposals = server.http.get(f"/sessions/{session}/node-proposals").json()["proposals"]
    (marked,) = (p for p in proposals if p["node"] == node)
    assert truth.nodes_at(marked, 1e-3) == [node]
    assert sorted(truth.nodes_at(p, 0.02) for p in proposals) == sorted([n] for n in truth.nodes)


def test_a_job_finds_nodes_when_it_is_asked_to(server: Any, session: str) -> None:
    set_marks(server, session, {})
    ended = []
    for parameters in ({"surface": False}, {"surface": False, "infer_nodes": True}):
        job = server.http.post(f"/sessions/{session}/reconstructions", json=parameters).json()
        while job["state"] in ("queued", "running"):
            time.sleep(0.05)
            job = server.http.get(f"/reconstructions/{job['id']}").json()
        ended.append(job)
    assert [job["state"] for job in ended] == ["failed", "done"]
    assert "have the nodes found" in ended[0]["error"]
    report = server.http.get(f"/reconstructions/{ended[1]['id']}/report.json").json()
    assert sum(p["used"] for p in report["nodes"]["proposals"]) == 12


def test_where_there_is_nothing_to_begin_with_it_says_so(server: Any, ride: Any, line: Any) -> None:
    session = server.new_session()
    rider = ride("alone", session)
    messages = [m for m in line(20) if m["type"] != "node"]
    for seq, message in enumerate(messages):
        rider.send({**message, "seq": seq})
    rider.wait_for_ack(len(messages) - 1)
    answer = server.http.get(f"/sessions/{session}/node-proposals")
    assert (answer.status_code, "closed curve or a marked node" in answer.json()["detail"]) == (422, True)
    assert server.http.get("/sessions/none/node-proposals").status_code == 404
