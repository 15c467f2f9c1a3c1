"""Sessions, curves and errors over HTTP."""

import re
from typing import Any
from urllib.parse import urljoin, urlsplit

import pytest


def test_a_session_lives(server: Any) -> None:
    made = server.http.post("/sessions", json={"id": "lamp", "name": "Lamp"})
    assert (made.status_code, made.headers["location"]) == (201, "/api/v1/sessions/lamp")
    assert server.http.get(made.headers["location"].removeprefix("/api/v1")).json() == made.json()
    renamed = server.http.patch("/sessions/lamp", json={"name": "Desk lamp"}).json()
    assert renamed == {**made.json(), "name": "Desk lamp"}
    assert server.http.patch("/sessions/lamp", json={}).json() == renamed
    assert server.http.post("/sessions", json={"id": "lamp"}).status_code == 409
    assert server.http.delete("/sessions/lamp").status_code == 204
    assert server.http.get("/sessions/lamp").status_code == 404


def test_pages_of_sessions_are_the_whole_list(start_server: Any) -> None:
    server = start_server()
    made = [server.new_session(name=str(i)) for i in range(7)]
    seen, path = [], "/sessions?limit=3"
    while path:
        page = server.http.get(path)
        seen += [s["id"] for s in page.json()]
        path = page.headers.get("link", "").partition(">")[0].removeprefix("</api/v1")
    assert seen == made[::-1]


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("GET", "/sessions/none", None, 404),
        ("PATCH", "/sessions/none", {"name": "x"}, 404),
        ("DELETE", "/sessions/none", None, 404),
        ("GET", "/sessions/none/curves", None, 404),
        ("PATCH", "/sessions/none/curves/0", {}, 404),
        ("GET", "/sessions/none/recordings", None, 404),
        ("GET", "/sessions/none/recordings/x", None, 404),
        ("POST", "/sessions/none/reconstructions", {}, 404),
        ("GET", "/sessions/none/reconstructions", None, 404),
        ("GET", "/reconstructions/none", None, 404),
        ("POST", "/reconstructions/none/cancel", None, 404),
        ("GET", "/reconstructions/none/mesh.glb", None, 404),
        ("GET", "/reconstructions/none/passwd", None, 422),
        ("GET", "/nothing", None, 404),
        ("PUT", "/sessions", {}, 405),
        ("POST", "/sessions", {"id": "../etc"}, 422),
        ("POST", "/sessions", {"nmae": "typo"}, 422),
        ("POST", "/sessions", {"name": 7}, 422),
        ("POST", "/sessions", {"name": "no\x00name"}, 422),
        ("GET", "/sessions?limit=0", None, 422),
        ("GET", "/sessions?after=none", None, 404),
        ("GET", "/sessions/none/curves/99999999999999999999", None, 422),
    ],
)
def test_every_error_is_a_problem(server: Any, method: str, path: str, body: Any, status: int) -> None:
    answer = server.http.request(method, path, json=body)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert (problem["status"], problem["instance"]) == (status, f"/api/v1{path.partition('?')[0]}")
    assert problem["title"]
    assert problem["detail"]


def test_a_body_that_is_no_json_is_a_problem(server: Any) -> None:
    answer = server.http.post("/sessions", content=b'{"name": ', headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["status"]) == (422, 422)
    deep = server.http.post("/sessions", content=b"[" * 100_000, headers={"Content-Type": "application/json"})
    assert (deep.status_code, deep.json()["status"]) == (400, 400)


def test_curves_are_edited_and_samples_stay(server: Any, ride: Any, line: Any) -> None:
    session = server.new_session()
    rider = ride("edit", session)
    messages = line(30)
    for message in messages:
        rider.send(message)
    rider.wait_for_ack(len(messages) - 1)
    before = server.http.get(f"/sessions/{session}/recordings/edit").content
    marks = [{"sample": 3, "node": 9}, {"sample": 20, "node": 4}]
    changed = server.http.patch(f"/sessions/{session}/curves/0", json={"boundary": True, "marks": marks}).json()
    assert (changed["boundary"], changed["closed"], changed["marks"]) == (True, False, marks)
    assert server.http.get(f"/sessions/{session}/curves/0").json() == changed
    beyond = server.http.patch(f"/sessions/{session}/curves/0", json={"marks": [{"sample": 30, "node": 1}]})
    assert (beyond.status_code, "30 samples" in beyond.json()["detail"]) == (422, True)
    assert server.http.get(f"/sessions/{session}/curves/0").json() == changed
    server.http.patch(f"/sessions/{session}/curves/0", json={"removed": True})
    assert server.http.get(f"/sessions/{session}/curves").json() == []
    assert server.http.get(f"/sessions/{session}").json()["nodes"] == 0
    server.http.patch(f"/sessions/{session}/curves/0", json={"removed": False})
    assert server.http.get(f"/sessions/{session}/curves").json() == [changed]
    assert server.http.get(f"/sessions/{session}/recordings/edit").content == before


def test_a_session_with_everything_in_it_is_deleted(server: Any, ride: Any, line: Any) -> None:
    session = server.new_session()
    rider = ride("gone", session)
    for message in line(30):
        rider.send(message)
    rider.wait_for_ack(6)
    job = server.http.post(f"/sessions/{session}/reconstructions").json()["id"]
    server.http.delete(f"/sessions/{session}")
    for path in (f"/sessions/{session}/curves", f"/sessions/{session}/recordings/gone", f"/reconstructions/{job}"):
        assert server.http.get(path).status_code == 404


def test_the_api_describes_itself(server: Any) -> None:
    described = server.http.get(f"http://127.0.0.1:{server.port}/openapi.json").json()
    assert described["info"]["title"] == "tracemesh"
    for path, operations in described["paths"].items():
        for operation in operations.values():
            assert operation["summary"], path
            assert operation["description"], path


def test_its_page_needs_no_other_host(server: Any) -> None:
    page = server.http.get(f"http://127.0.0.1:{server.port}/docs").text
    assets = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert len(assets) >= 2
    for asset in assets:
        assert urlsplit(asset).netloc in ("", f"127.0.0.1:{server.port}")
        assert server.http.get(urljoin(f"http://127.0.0.1:{server.port}/docs", asset)).status_code == 200
