"""A reconstructed surface beside a true one, and a session's scan for other programs."""

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracemesh.formats.meshes import read_mesh, write_triangles
from tracemesh.formats.rawnet import read_rawnet, write_rawnet
from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan

TURN = Rotation.from_euler("xyz", [20, -10, 35], degrees=True)


@pytest.fixture(scope="module")
def plain(start_server: Callable[..., Any]) -> Any:
    """A server; nothing here depends on its database."""
    return start_server()


@pytest.fixture(scope="module")
def leaf_mesh(plain: Any) -> tuple[str, str]:
    """A session with an exact scan of the leaf, and its reconstruction."""
    session = plain.new_session()
    scan = write_rawnet(exact_scan(leaf(), 0.01))
    plain.http.post(f"/sessions/{session}/recordings", content=scan.encode()).raise_for_status()
    job = plain.http.post(f"/sessions/{session}/reconstructions").json()["id"]
    while (state := plain.http.get(f"/reconstructions/{job}").json()["state"]) in ("queued", "running"):
        time.sleep(0.05)
    assert state == "done"
    return session, job


def compare(server: Any, job: str, truth: bytes, name: str = "truth.obj", **options: str) -> list[dict[str, Any]]:
    url = f"/reconstructions/{job}/comparison"
    answer = server.http.post(url, content=truth, params={"truth": name, **options})
    assert answer.status_code == 200, answer.text
    return [json.loads(line) for line in answer.text.splitlines()]


def test_a_turned_truth_is_registered_and_every_vertex_is_measured(plain: Any, leaf_mesh: tuple[str, str]) -> None:
    _, job = leaf_mesh
    vertices, faces = leaf().mesh()
    turned = TURN.apply(vertices) + np.array([0.3, -1.0, 2.0])
    *progress, found = compare(plain, job, write_triangles(turned, faces, "obj"))
    assert progress[0] == {"type": "progress", "stage": "registering", "fraction": 0.0}
    assert [p["fraction"] for p in progress] == sorted(p["fraction"] for p in progress)
    assert found["type"] == "comparison"
    assert found["mean"] < 0.05
    assert found["scale"] == 1.0
    mesh, _ = read_mesh(plain.http.get(f"/reconstructions/{job}/mesh.glb").content, "glb")
    placed = mesh @ np.array(found["rotation"]).T + found["translation"]
    assert np.allclose(ClosestPoints(turned, faces)(placed)[1], np.abs(found["signed_distance"]), atol=1e-9)
    percent = 100 * np.abs(found["signed_distance"]) / found["diagonal"]
    assert found["max"] == pytest.approx(percent.max())
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(percent**2)))


def test_the_sign_says_on_which_side_of_the_truth_a_vertex_is(plain: Any, leaf_mesh: tuple[str, str]) -> None:
    vertices, faces = leaf().mesh()
    for shift in (-0.02, 0.02):
        found = compare(
            plain,
            leaf_mesh[1],
            write_triangles(vertices + np.array([0, 0, shift]), faces, "ply"),
            "t.ply",
            align="none",
        )
        signs = np.sign(found[-1]["signed_distance"])
        assert np.mean(signs == -np.sign(shift)) > 0.95  # the leaf's outside is above it


@pytest.mark.parametrize(("name", "content"), [("t.obj", b"v 1 2\n"), ("t.doc", b"x"), ("t.ply", b"")])
def test_a_file_that_is_no_mesh_is_refused_in_words(
    name: str, content: bytes, plain: Any, leaf_mesh: tuple[str, str]
) -> None:
    answer = plain.http.post(f"/reconstructions/{leaf_mesh[1]}/comparison", content=content, params={"truth": name})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(f"{name}: ")


def test_only_a_mesh_can_be_compared(plain: Any) -> None:
    answer = plain.http.post("/reconstructions/nothing/comparison", content=b"", params={"truth": "t.obj"})
    assert answer.status_code == 404


def test_a_scan_leaves_as_a_rawnet_and_comes_in_again(plain: Any, leaf_mesh: tuple[str, str]) -> None:
    exported = plain.http.get(f"/sessions/{leaf_mesh[0]}/scan.rawnet")
    assert exported.headers["content-disposition"].endswith('.rawnet"')
    again, before = read_rawnet(exported.text), exact_scan(leaf(), 0.01)
    for one, two in zip(again.curves, before.curves, strict=True):
        for name in ("distance", "tangent", "normal"):
            assert np.allclose(getattr(one, name), getattr(two, name), atol=1e-7), name
    empty = plain.http.get(f"/sessions/{plain.new_session()}/scan.rawnet")
    assert empty.status_code == 422
    assert "no curve" in empty.json()["detail"]
