"""The network while a slider moves."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracemesh.formats.rawnet import read_rawnet
from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.wire.live import Preview


@pytest.fixture
def session(server: Any, shared_data: Path) -> str:
    """A session with the thesis author's scan."""
    made: str = server.new_session()
    server.http.post(f"/sessions/{made}/recordings", content=(shared_data / "lilium.rawnet").read_bytes())
    return made


def test_it_is_the_network_that_the_kernel_gives(server: Any, session: str, shared_data: Path) -> None:
    answer = server.http.post(f"/sessions/{session}/preview", json={"step": "3%", "bend": 0.05})
    preview = Preview.model_validate(answer.json())
    scan = read_rawnet((shared_data / "lilium.rawnet").read_text())
    network = reconstruct_network(scan, NetworkParameters(step_fraction=0.03, bend=0.05)).network
    points = np.unique(np.concatenate([np.reshape(c.positions, (-1, 3)) for c in preview.curves]), axis=0)
    assert points == pytest.approx(np.unique(np.round(network.points, 5), axis=0), abs=2e-5)
    assert [c.index for c in preview.curves] == [0, 1, 2]
    for node, point in zip(preview.nodes, network.nodes, strict=True):
        assert node.position == pytest.approx(network.points[point], abs=1e-6)


def test_an_edit_is_seen_at_once(server: Any, session: str) -> None:
    before = server.http.post(f"/sessions/{session}/preview").json()
    server.http.patch(f"/sessions/{session}/curves/2", json={"removed": True})
    after = server.http.post(f"/sessions/{session}/preview").json()
    assert (len(before["curves"]), len(after["curves"])) == (3, 2)


def test_samples_that_arrive_are_seen(server: Any, ride: Any, line: Any) -> None:
    session = server.new_session()
    rider = ride("more", session)
    messages = line(60)
    for message in messages[:4]:
        rider.send(message)
    rider.wait_for_ack(3)
    short = server.http.post(f"/sessions/{session}/preview", json={"step": "0.005"})
    for message in messages[4:]:
        rider.send(message)
    rider.wait_for_ack(len(messages) - 1)
    long = server.http.post(f"/sessions/{session}/preview", json={"step": "0.005"})
    lengths = [np.ptp(r.json()["curves"][0]["positions"][::3]) for r in (short, long)]
    assert lengths == pytest.approx([0.029, 0.059], abs=1e-4)


def test_only_the_newest_wish_of_a_client_is_answered(server: Any, session: str) -> None:
    """Many wishes at once: the last one is answered, and none that was overtaken costs a solution."""
    path = f"/sessions/{session}/preview?client=slider"
    with ThreadPoolExecutor(8) as pool:
        answers = list(
            pool.map(lambda step: server.http.post(path, json={"step": f"{step}%"}).status_code, range(2, 22))
        )
    assert set(answers) <= {200, 409}
    assert 200 in answers
    assert server.http.post(path).status_code == 200


def test_what_cannot_be_solved_says_why(server: Any) -> None:
    answer = server.http.post(f"/sessions/{server.new_session()}/preview")
    assert (answer.status_code, "no curve with samples" in answer.json()["detail"]) == (422, True)
    assert server.http.post("/sessions/none/preview").status_code == 404


def test_every_point_says_at_which_sample_it_is(server: Any, session: str) -> None:
    """Marks are points of the network at their own samples, also on a closed curve that begins between two marks."""
    curves = server.http.get(f"/sessions/{session}/curves").json()
    marks = sorted({m["node"]: m for m in reversed(curves[0]["marks"])}.values(), key=lambda m: m["sample"])
    marks = [{"sample": mark["sample"] + 7, "node": mark["node"]} for mark in marks]
    wish = {"marks": [{"curve": 0, "marks": marks}]}
    preview = Preview.model_validate(server.http.post(f"/sessions/{session}/preview", json=wish).json())
    nodes = {node.node: node.position for node in preview.nodes}
    for curve, known in zip(preview.curves, [marks, curves[1]["marks"], curves[2]["marks"]], strict=True):
        points, samples = np.reshape(curve.positions, (-1, 3)), np.array(curve.samples)
        assert len(points) == len(samples)
        for mark in known:
            (found,) = np.flatnonzero(samples == mark["sample"])[:1]
            assert points[found] == pytest.approx(nodes[mark["node"]], abs=2e-5)
        assert np.count_nonzero(np.diff(samples) < 0) == (1 if curve.closed else 0)


def test_marks_that_are_tried_give_what_they_give_when_stored(server: Any, session: str) -> None:
    path = f"/sessions/{session}"
    (moved, *_), stored = server.http.get(f"{path}/curves").json()[1]["marks"], server.http.get(f"{path}/curves").json()
    marks = [{**mark, "sample": mark["sample"] + (3 if mark == moved else 0)} for mark in stored[1]["marks"]]
    tried = server.http.post(f"{path}/preview", json={"marks": [{"curve": 1, "marks": marks}]}).json()
    assert server.http.get(f"{path}/curves").json() == stored
    assert tried["curves"] != server.http.post(f"{path}/preview").json()["curves"]
    server.http.patch(f"{path}/curves/1", json={"marks": marks})
    assert server.http.post(f"{path}/preview").json()["curves"] == tried["curves"]


def test_marks_where_nothing_is_are_refused(server: Any, session: str) -> None:
    for curve, sample in ((9, 0), (1, 10**6)):
        wish = {"marks": [{"curve": curve, "marks": [{"sample": sample, "node": 0}]}]}
        answer = server.http.post(f"/sessions/{session}/preview", json=wish)
        assert (answer.status_code, f"curve {curve}" in answer.json()["detail"]) == (422, True)
