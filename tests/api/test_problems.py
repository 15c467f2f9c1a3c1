"""Problems say where they are, and the edits that they propose mend them."""

import itertools
import re
import time
from pathlib import Path
from typing import Any

import pytest

from tracemesh.wire.resources import NetworkProblem, NetworkProblems


@pytest.fixture
def session(server: Any, shared_data: Path) -> str:
    """A session with the thesis author's scan, whose curves are a network as they are."""
    made: str = server.new_session()
    server.http.post(f"/sessions/{made}/recordings", content=(shared_data / "lilium.rawnet").read_bytes())
    assert problems(server, made) == []
    return made


def problems(server: Any, session: str) -> list[NetworkProblem]:
    return NetworkProblems.model_validate(server.http.get(f"/sessions/{session}/problems").json()).problems


def edit(server: Any, session: str, curve: int, **change: Any) -> None:
    server.http.patch(f"/sessions/{session}/curves/{curve}", json=change).raise_for_status()


def mend(server: Any, session: str, problem: NetworkProblem) -> None:
    assert problem.fix is not None
    assert problem.fix.changes
    for change in problem.fix.changes:
        edit(server, session, change.curve, **change.change.model_dump(exclude_none=True))


def marks(server: Any, session: str, curve: int) -> list[dict[str, int]]:
    found: list[dict[str, int]] = server.http.get(f"/sessions/{session}/curves/{curve}").json()["marks"]
    return found


def test_a_boundary_inside_the_surface(server: Any, session: str) -> None:
    edit(server, session, 1, boundary=True)
    found = problems(server, session)
    assert {tuple(p.curves) for p in found} == {(1,)}
    assert [p.fix.label if p.fix else "" for p in found] == ["Mark curve 2 as interior"] * 2
    numbers = [mark["sample"] for mark in marks(server, session, 1)]
    assert [p.samples for p in found] == list(itertools.pairwise(numbers))
    mend(server, session, found[0])
    assert problems(server, session) == []


def test_a_closed_curve_that_is_none(server: Any, session: str) -> None:
    edit(server, session, 2, closed=True)
    (found,) = problems(server, session)
    assert (found.severity, found.curves) == ("error", [2])
    assert found.message.startswith("curve 3")
    assert found.fix is not None
    assert found.fix.label == "Mark curve 3 as open"
    mend(server, session, found)
    assert problems(server, session) == []


def test_a_loose_end_near_a_curve_is_joined_to_it(server: Any, session: str) -> None:
    first, *rest = marks(server, session, 0)
    lost = rest[0]
    edit(server, session, 0, marks=[first, *rest[1:]])
    found = problems(server, session)
    (loose,) = [p for p in found if f"{lost['node']}" in p.message]
    (curve,) = loose.curves
    assert loose.samples is not None
    assert {"sample": loose.samples[0], "node": lost["node"]} in marks(server, session, curve)
    assert loose.fix is not None
    assert loose.fix.label.startswith("Join it to curve 1, ")
    mend(server, session, loose)
    assert problems(server, session) == []
    assert any(m["node"] == lost["node"] for m in marks(server, session, 0))


def test_curves_in_pieces_ask_for_nodes_to_be_found(server: Any, session: str) -> None:
    edit(server, session, 2, marks=[])
    (found,) = problems(server, session)
    assert found.curves == [2]
    assert "pieces" in found.message
    assert found.fix is not None
    assert found.fix.changes == []


def test_people_are_told_their_own_numbers(server: Any, session: str) -> None:
    for curve in range(3):
        edit(server, session, curve, marks=[{**m, "node": 10 * m["node"] + 7} for m in marks(server, session, curve)])
    edit(server, session, 1, boundary=True)
    numbers = [mark["node"] for mark in marks(server, session, 1)]
    wanted = [f"segment {a}-{b} of curve 2 is marked as boundary" for a, b in itertools.pairwise(numbers)]
    assert [w in p.message for w, p in zip(wanted, problems(server, session), strict=True)] == [True, True]


def test_whatever_fails_names_the_curves_as_the_page_does(server: Any, session: str) -> None:
    """Curve 1 is gone and curve 3 hangs on nothing: problems, a preview, found nodes and a job say so of curve 3."""
    edit(server, session, 0, removed=True)
    edit(server, session, 2, marks=[mark | {"node": 100 + i} for i, mark in enumerate(marks(server, session, 2))])
    said = [p.message for p in problems(server, session) if p.severity == "error"]
    said.append(server.http.post(f"/sessions/{session}/preview").json()["detail"])
    job = server.http.post(f"/sessions/{session}/reconstructions", json={}).json()
    while (found := server.http.get(f"/reconstructions/{job['id']}").json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    said.append(found["error"])
    named = [re.findall(r"curve (\d+)", message) for message in said]
    assert len(said) == 3
    assert all("3" in numbers and "1" not in numbers for numbers in named), said


def test_what_fits_badly_is_shown_where_it_is(server: Any, session: str) -> None:
    """Two nodes of a curve change their numbers, and the curve before it is gone: people know it by its own number."""
    edit(server, session, 1, removed=True)
    first, *between, last = marks(server, session, 2)
    swapped = [first | {"node": last["node"]}, *between, last | {"node": first["node"]}]
    edit(server, session, 2, marks=swapped)
    warnings = [p for p in problems(server, session) if p.severity == "warning"]
    assert warnings
    (worst, *_) = warnings
    assert worst.message.startswith(f"curve {worst.curves[0] + 1} misses its node by ")
    ends = [mark["sample"] for mark in marks(server, session, worst.curves[0])]
    assert worst.samples in itertools.pairwise(ends)
    assert 2 in [curve for warning in warnings for curve in warning.curves]


def test_nothing_scanned_is_a_problem_and_no_session_an_error(server: Any) -> None:
    (found,) = problems(server, server.new_session())
    assert "no curve with samples" in found.message
    assert server.http.get("/sessions/nowhere/problems").status_code == 404
