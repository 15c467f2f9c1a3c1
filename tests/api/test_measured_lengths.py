"""Lengths that somebody measured: kept by the curve, used by every network, carried along when a mark moves."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracemesh.wire.live import Preview


@pytest.fixture
def session(server: Any, shared_data: Path) -> str:
    """A session with the thesis author's scan."""
    made: str = server.new_session()
    server.http.post(f"/sessions/{made}/recordings", content=(shared_data / "lilium.rawnet").read_bytes())
    return made


def curve(server: Any, session: str, index: int) -> dict[str, Any]:
    found: dict[str, Any] = server.http.get(f"/sessions/{session}/curves/{index}").json()
    return found


def drawn(server: Any, session: str, index: int) -> list[float]:
    """Lengths, m, of a curve's segments as the preview draws them."""
    return drawn_between(
        server, session, index, [mark["sample"] for mark in curve(server, session, index)["marks"][:-1]]
    )


def drawn_between(server: Any, session: str, index: int, samples: list[int]) -> list[float]:
    """Lengths, m, from each of these samples of a curve to the next one, and from the last to its end."""
    preview = Preview.model_validate(server.http.post(f"/sessions/{session}/preview").json())
    line = preview.curves[index]
    steps = np.linalg.norm(np.diff(np.reshape(line.positions, (-1, 3)), axis=0), axis=1)
    places = [line.samples.index(sample) for sample in samples]
    return [float(steps[a:b].sum()) for a, b in pairwise([*places, len(steps)])]


def give(server: Any, session: str, index: int, *lengths: tuple[int, int, float]) -> Any:
    body = {"lengths": [{"first": a, "last": b, "length": m} for a, b, m in lengths]}
    return server.http.patch(f"/sessions/{session}/curves/{index}", json=body)


@pytest.mark.parametrize("index", [0, 1])
def test_a_length_stretches_its_segment_until_it_is_taken_back(server: Any, session: str, index: int) -> None:
    marks = curve(server, session, index)["marks"]
    before = drawn(server, session, index)
    give(server, session, index, (marks[0]["sample"], marks[1]["sample"], 1.3 * before[0])).raise_for_status()
    longer = drawn(server, session, index)
    assert longer[0] > 1.1 * before[0]
    assert longer[-1] < 1.1 * before[-1]
    give(server, session, index)
    assert drawn(server, session, index) == pytest.approx(before, rel=1e-4)


@pytest.mark.parametrize("closed", [False, True])
def test_a_curve_without_marks_is_measured_as_a_whole(server: Any, session: str, closed: bool) -> None:
    path = f"/sessions/{session}/curves"
    for other in server.http.get(path).json()[1:]:
        server.http.patch(f"{path}/{other['index']}", json={"removed": True}).raise_for_status()
    alone = server.http.patch(f"{path}/0", json={"marks": [], "closed": closed}).json()
    give(server, session, 0, (0, alone["samples"] - 1, 3.0)).raise_for_status()
    preview = Preview.model_validate(server.http.post(f"/sessions/{session}/preview").json())
    steps = np.diff(np.reshape(preview.curves[0].positions, (-1, 3)), axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(3.0, rel=0.1)


def test_a_branch_is_measured_on_both_sides_of_its_only_mark(server: Any, session: str) -> None:
    known = curve(server, session, 1)
    middle = known["marks"][1]
    change = {"marks": [middle]}
    server.http.patch(f"/sessions/{session}/curves/1", json=change).raise_for_status()
    before, after = drawn_between(server, session, 1, [0, middle["sample"]])
    last = known["samples"] - 1
    give(server, session, 1, (0, middle["sample"], 0.7 * before), (middle["sample"], last, 1.3 * after))
    lengths = drawn_between(server, session, 1, [0, middle["sample"]])
    assert lengths == pytest.approx([0.7 * before, 1.3 * after], rel=0.02)


def test_it_goes_with_a_mark_that_moves_and_sleeps_while_another_is_between(server: Any, session: str) -> None:
    marks = curve(server, session, 1)["marks"]
    first, second = marks[0]["sample"], marks[1]["sample"]
    give(server, session, 1, (first, second, 1.5)).raise_for_status()
    path = f"/sessions/{session}/curves/1"
    moved = [marks[0], {**marks[1], "sample": second + 2}, *marks[2:]]
    assert server.http.patch(path, json={"marks": moved}).json()["lengths"] == [
        {"first": first, "last": second + 2, "length": 1.5}
    ]
    assert server.http.patch(path, json={"marks": marks}).json()["lengths"][0]["last"] == second
    long = drawn(server, session, 1)
    between = [marks[0], {"sample": (first + second) // 2, "node": 77}, *marks[1:]]
    server.http.patch(path, json={"marks": between})
    assert sum(drawn(server, session, 1)[:2]) < 0.9 * long[0]
    server.http.patch(path, json={"marks": marks})
    assert drawn(server, session, 1) == pytest.approx(long, rel=1e-4)


def test_what_is_no_length_is_refused(server: Any, session: str) -> None:
    for wrong in ((0, 10**6, 1.0), (0, 5, 0.0), (0, 5, -1.0)):
        assert give(server, session, 1, *[wrong]).status_code == 422
    assert curve(server, session, 1)["lengths"] == []


def test_an_archive_keeps_it(server: Any, session: str) -> None:
    give(server, session, 2, (0, 5, 0.25)).raise_for_status()
    archive = server.http.get(f"/sessions/{session}/archive").content
    again = server.http.post("/sessions/archive", content=archive).json()["id"]
    assert curve(server, again, 2)["lengths"] == [{"first": 0, "last": 5, "length": 0.25}]
