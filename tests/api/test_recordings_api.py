"""Files in, recordings out, reconstructions and their files."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tracemesh.formats.networks import read_network


@pytest.fixture
def lilium(shared_data: Path) -> bytes:
    """The thesis author's own rawnet."""
    return (shared_data / "lilium.rawnet").read_bytes()


def test_a_rawnet_is_taken_in_as_if_a_device_had_sent_it(server: Any, lilium: bytes) -> None:
    session = server.new_session()
    answer = server.http.post(f"/sessions/{session}/recordings", content=lilium)
    assert answer.status_code == 201
    assert server.http.get(answer.headers["location"].removeprefix("/api/v1")).status_code == 200
    summary = server.http.get(f"/sessions/{session}").json()
    assert (summary["curves"], summary["nodes"]) == (3, 5)
    assert server.http.get(f"/sessions/{session}/recordings").json() == [answer.json()]


def test_curves_and_recordings_come_in_pages(server: Any, lilium: bytes) -> None:
    session = server.new_session()
    for _ in range(3):
        server.http.post(f"/sessions/{session}/recordings", content=lilium)
    server.http.patch(f"/sessions/{session}/curves/4", json={"removed": True})
    for what in ("curves", "recordings"):
        whole = server.http.get(f"/sessions/{session}/{what}")
        assert "link" not in whole.headers
        found, path = [], f"/sessions/{session}/{what}?limit=2"
        while path:
            page = server.http.get(path)
            assert len(page.json()) <= 2
            found += page.json()
            path = page.headers.get("link", "").partition(">")[0].removeprefix("</api/v1")
        assert found == whole.json()
    assert [c["index"] for c in server.http.get(f"/sessions/{session}/curves").json()] == [0, 1, 2, 3, 5, 6, 7, 8]
    assert server.http.get(f"/sessions/{session}/curves?after=x").status_code == 422
    assert server.http.get(f"/sessions/{session}/recordings?after=x").status_code == 404


def test_replaying_an_export_gives_the_same_session(server: Any, lilium: bytes) -> None:
    first, second = server.new_session(), server.new_session()
    recording = server.http.post(f"/sessions/{first}/recordings", content=lilium).json()["id"]
    exported = server.http.get(f"/sessions/{first}/recordings/{recording}").content
    assert server.http.post(f"/sessions/{second}/recordings", content=exported).status_code == 201
    assert server.http.get(f"/sessions/{second}/recordings/{recording}").content == exported
    curves = [server.http.get(f"/sessions/{s}/curves").json() for s in (first, second)]
    assert curves[0] == curves[1]


def test_uploading_again_adds_nothing_and_a_part_is_completed(server: Any, lilium: bytes) -> None:
    session, other = server.new_session(), server.new_session()
    recording = server.http.post(f"/sessions/{session}/recordings", content=lilium).json()["id"]
    lines = server.http.get(f"/sessions/{session}/recordings/{recording}").text.splitlines()
    for text in ("\n".join(lines[:4]), "\r\n".join(lines), "\n".join(lines)):
        assert server.http.post(f"/sessions/{other}/recordings", content=text.encode()).status_code == 201
    assert server.http.get(f"/sessions/{other}/recordings/{recording}").text == "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "wanted"),
        (b"\xff\xfe\x00", "UTF-8"),
        (b"1\n1\n0\nnonsense", "line 4"),
        (b'{"type": "hello"', "line 1"),
        (b'{"type":"hello","recording":"r","device":{"id":"d","kind":"k"}}\n{"type":"node","seq":0}', "line 2"),
        (
            b'{"type":"hello","recording":"r","device":{"id":"d","kind":"k"}}\n'
            b'{"type":"node","seq":0,"curve":0,"sample":0,"node":0}',
            "never started",
        ),
    ],
)
def test_a_wrong_file_says_where_and_leaves_nothing(server: Any, content: bytes, says: str) -> None:
    session = server.new_session()
    answer = server.http.post(f"/sessions/{session}/recordings", content=content)
    assert (answer.status_code, answer.headers["content-type"]) == (422, "application/problem+json")
    assert says in answer.json()["detail"]
    assert server.http.get(f"/sessions/{session}/recordings").json() == []


def test_a_file_that_is_too_big_is_refused(start_server: Callable[..., Any]) -> None:
    small = start_server(max_upload_bytes=1000)
    session = small.new_session()
    answer = small.http.post(f"/sessions/{session}/recordings", content=b"#" * 5000)
    assert (answer.status_code, "1000 bytes" in answer.json()["detail"]) == (422, True)


def test_a_session_becomes_a_mesh(server: Any, lilium: bytes) -> None:
    session = server.new_session()
    server.http.post(f"/sessions/{session}/recordings", content=lilium)
    answer = server.http.post(f"/sessions/{session}/reconstructions", json={"step": "3%"})
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["location"] == f"/api/v1/reconstructions/{job['id']}"
    while (state := server.http.get(f"/reconstructions/{job['id']}").json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    assert state["state"] == "done", state
    assert server.http.get(f"/sessions/{session}").json()["latest_reconstruction"] == job["id"]
    assert [j["id"] for j in server.http.get(f"/sessions/{session}/reconstructions").json()] == [job["id"]]
    assert server.http.post(f"/reconstructions/{job['id']}/cancel").status_code == 409
    assert read_network(server.http.get(f"/reconstructions/{job['id']}/network.json").text).diagonal > 0
    assert json.loads(server.http.get(f"/reconstructions/{job['id']}/report.json").text)["surface"]
    _conditional_and_partial(server, f"/reconstructions/{job['id']}/mesh.glb")


def _conditional_and_partial(server: Any, path: str) -> None:
    packed = server.http.get(path)
    whole = server.http.get(path, headers={"Accept-Encoding": "identity"})
    assert (packed.content, packed.headers["etag"]) == (whole.content, f"W/{whole.headers['etag']}")
    assert (whole.headers["content-type"], whole.content[:4]) == ("model/gltf-binary", b"glTF")
    etag = whole.headers["etag"]
    for known in (etag, f'"other", {etag}', f"W/{etag}", "*"):
        answer = server.http.get(path, headers={"If-None-Match": known})
        assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", etag)
    assert server.http.get(path, headers={"If-None-Match": '"other"'}).status_code == 200
    part = server.http.get(path, headers={"Range": "bytes=4-11", "If-Range": etag})
    assert (part.status_code, part.content) == (206, whole.content[4:12])
    assert part.headers["content-range"] == f"bytes 4-11/{len(whole.content)}"
    beyond = server.http.get(path, headers={"Range": f"bytes={len(whole.content)}-"})
    assert (beyond.status_code, beyond.headers["content-range"]) == (416, f"bytes */{len(whole.content)}")
    malformed = server.http.get(path, headers={"Range": "bytes=b-a"})
    assert malformed.status_code == 400
    for refused in (beyond, malformed):
        assert refused.headers["content-type"] == "application/problem+json"
        assert (refused.json()["status"], refused.json()["instance"]) == (refused.status_code, f"/api/v1{path}")
        assert "range" in refused.json()["detail"].lower()
