"""Two servers that share a database and a bucket, each with a data folder of its own."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


def finished(server: Any, job: str) -> dict[str, Any]:
    while (state := server.http.get(f"/reconstructions/{job}").json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    return dict(state)


@pytest.mark.parametrize("database_kind", ["postgresql"], indirect=True)
def test_any_server_serves_what_one_of_them_made_and_a_bucket_that_is_away_is_named(
    start_server: Callable[..., Any], new_database: Callable[[str], str], s3: Any, shared_data: Path
) -> None:
    database_url = new_database("postgresql")
    here, there = (start_server(database_url=database_url, artifact_bucket=s3.bucket) for _ in range(2))
    session = here.new_session()
    here.http.post(f"/sessions/{session}/recordings", content=(shared_data / "lilium.rawnet").read_bytes())
    jobs = f"/sessions/{session}/reconstructions"
    done = finished(here, here.http.post(jobs, json={"step": "6%"}).json()["id"])
    glb = done["artifacts"]["mesh.glb"].removeprefix("/api/v1")
    part = there.http.get(glb, headers={"Range": "bytes=0-3"})
    assert (part.status_code, part.content) == (206, b"glTF")
    s3.stop()
    assert there.http.get(glb).content == here.http.get(glb).content  # it was fetched before
    away = there.http.get(done["artifacts"]["report.json"].removeprefix("/api/v1"))
    assert away.status_code == 503
    assert s3.bucket in away.json()["detail"]
    failed = finished(there, there.http.post(jobs, json={"step": "6%", "surface": False}).json()["id"])
    assert failed["state"] == "failed"
    assert s3.bucket in failed["error"]
    s3.start()
    again = finished(there, there.http.post(jobs, json={"step": "6%", "surface": False}).json()["id"])
    assert again["state"] == "done"
    assert "format" in here.http.get(again["artifacts"]["network.json"].removeprefix("/api/v1")).json()
