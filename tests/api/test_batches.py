"""Many scans at once."""

import io
import time
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tracemesh.formats.meshes import read_mesh


def zipped(**files: str | bytes) -> bytes:
    """A zip; two underscores in a name are a dot."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in files.items():
            archive.writestr(name.replace("__", "."), content)
    return file.getvalue()


@pytest.fixture
def scan(shared_data: Path) -> bytes:
    return (shared_data / "lilium.rawnet").read_bytes()


def wait(server: Any, batch: str) -> Any:
    while (state := server.http.get(f"/batches/{batch}").json())["queued"] + state["running"]:
        time.sleep(0.05)
    return state


def test_every_scan_and_network_gets_a_session_and_a_mesh(server: Any, scan: bytes, shared_data: Path) -> None:
    network = next((shared_data / "networks").glob("*.network.json")).read_bytes()
    files = {"one__rawnet": scan, "two__network__json": network, "parameters__json": '{"step": "4%"}'}
    made = server.http.post("/batches?name=Leaves", content=zipped(**files))
    batch = made.json()
    assert (made.status_code, batch["size"], batch["name"]) == (202, 2, "Leaves")
    assert made.headers["location"] == f"/api/v1/batches/{batch['id']}"
    done = wait(server, batch["id"])
    assert (done["done"], done["fraction"]) == (2, 1.0)
    jobs = server.http.get(f"/batches/{batch['id']}/reconstructions?state=done").json()
    assert {job["batch"] for job in jobs} == {batch["id"]}
    assert jobs[-1]["parameters"]["step"] == "4%"
    names = [server.http.get(f"/sessions/{job['session']}").json()["name"] for job in jobs]
    assert names == ["two.network.json", "one.rawnet"]
    results = zipfile.ZipFile(io.BytesIO(server.http.get(f"/batches/{batch['id']}/results").content))
    assert sorted(Path(name).name for name in results.namelist()) == sorted(
        2 * ["mesh.glb", "network.json", "report.json"]
    )
    for name in results.namelist():
        if name.endswith("mesh.glb"):
            assert len(read_mesh(results.read(name), "glb")[1]) > 100
    assert server.http.get("/batches?limit=1").json() == [done]


def test_sending_it_again_makes_nothing_twice(server: Any, scan: bytes) -> None:
    content, key = zipped(one__rawnet=scan, parameters__json='{"step": "5%"}'), {"Idempotency-Key": "again"}
    first, second = (server.http.post("/batches", content=content, headers=key).json() for _ in range(2))
    assert first["id"] == second["id"]
    assert len(server.http.get(f"/batches/{first['id']}/reconstructions").json()) == 1
    other = server.http.post("/batches", content=zipped(a__rawnet=scan, b__rawnet=scan), headers=key)
    assert (other.status_code, "with 1 scans before" in other.json()["detail"]) == (409, True)


@pytest.mark.parametrize(
    ("files", "wanted"),
    [
        ({}, "wanted 1 to 10000 files"),
        ({"a__rawnet": None, "bad__rawnet": "this is no scan"}, "bad.rawnet: "),
        ({"bad__network__json": "{}"}, "bad.network.json: "),
        ({"parameters__json": "{}"}, "wanted 1 to 10000 files"),
        ({"good__rawnet": None, "parameters__json": '{"stop": 1}'}, "parameters.json: stop: "),
    ],
)
def test_nothing_is_stored_of_what_cannot_be_read(
    server: Any, scan: bytes, files: dict[str, str | None], wanted: str
) -> None:
    before = server.http.get("/sessions?limit=500").json()
    content = zipped(
        **{"first__rawnet": scan} if files and "first" in files else {}, **{k: v or scan for k, v in files.items()}
    )
    answer = server.http.post("/batches", content=content)
    assert (answer.status_code, answer.json()["detail"][: len(wanted)]) == (422, wanted)
    assert server.http.get("/sessions?limit=500").json() == before


def test_no_zip_and_a_zip_that_is_too_large_are_refused(start_server: Any) -> None:
    server = start_server(max_upload_bytes=10_000, max_session_bytes=100_000)
    assert "wanted a zip of scans" in server.http.post("/batches", content=b"no zip").json()["detail"]
    assert "at most 10000 bytes" in server.http.post("/batches", content=b"x" * 20_000).json()["detail"]
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb.rawnet", b"0" * 1_000_000)
    assert (
        "at most 100000 bytes when unpacked" in server.http.post("/batches", content=file.getvalue()).json()["detail"]
    )


def test_a_batch_is_cancelled(server: Any, scan: bytes) -> None:
    content = zipped(**{f"n{k}__rawnet": scan for k in range(4)}, parameters__json='{"step": "1%"}')
    batch = server.http.post("/batches", content=content).json()["id"]
    assert server.http.post(f"/batches/{batch}/cancel").status_code == 202
    ended = wait(server, batch)
    assert ended["cancelled"] >= 3
    assert ended["fraction"] == 1.0
    assert server.http.post("/batches/none/cancel").status_code == 404
