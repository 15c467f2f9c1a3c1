"""A curve network that is known already becomes a surface, by way of the job table."""

import json
import time
from pathlib import Path
from typing import Any

import pytest

from tracemesh.formats.meshes import read_mesh
from tracemesh.formats.networks import read_network
from tracemesh.pipeline import span

NAME = "networks/field-2.network.json"


def done(server: Any, job: dict[str, Any]) -> dict[str, Any]:
    while job["state"] in ("queued", "running"):
        time.sleep(0.05)
        job = server.http.get(f"/reconstructions/{job['id']}").json()
    return job


def test_its_surface_is_the_one_that_the_command_line_makes(server: Any, shared_data: Path) -> None:
    session, content = server.new_session(), (shared_data / NAME).read_bytes()
    answer = server.http.post(f"/sessions/{session}/networks", content=content)
    assert answer.status_code == 202
    job = done(server, answer.json())
    assert (job["state"], job["error"]) == ("done", None)
    assert server.http.get(f"/reconstructions/{job['id']}/network.json").content == content
    mesh = server.http.get(f"/reconstructions/{job['id']}/mesh.glb").content
    assert len(read_mesh(mesh, "glb")[1]) == len(span(read_network(content.decode())).mesh.faces)  # type: ignore[union-attr]
    assert server.http.get(f"/sessions/{session}").json()["latest_reconstruction"] == job["id"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"12 0 1\n", "wanted a curve network in JSON"),
        (b'{"format": "tracemesh-network", "version": 1}', "points"),
        (b"\xff", "wanted UTF-8 text, got byte 0xff at 0"),
    ],
)
def test_what_is_no_network_is_refused_and_leaves_nothing(server: Any, content: bytes, said: str) -> None:
    session = server.new_session()
    answer = server.http.post(f"/sessions/{session}/networks", content=content)
    assert (answer.status_code, said in answer.json()["detail"]) == (422, True), answer.text
    assert server.http.get(f"/sessions/{session}/reconstructions").json() == []


def test_a_session_that_is_not_there_takes_none(server: Any, shared_data: Path) -> None:
    answer = server.http.post("/sessions/nowhere/networks", content=(shared_data / NAME).read_bytes())
    assert answer.status_code == 404


def test_a_network_that_is_no_cell_complex_says_what_would_mend_it(server: Any, shared_data: Path) -> None:
    network = json.loads((shared_data / NAME).read_text())
    network["segments"] = network["segments"][1:]
    session = server.new_session()
    answer = server.http.post(f"/sessions/{session}/networks", content=json.dumps(network).encode())
    job = done(server, answer.json())
    assert job["state"] == "failed"
    assert "segment" in job["error"]
