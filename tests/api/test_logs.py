"""What the server writes down: lines that belong to a request or a job, and never a token."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from tests.api.conftest import free_port

TOKEN = "correct-horse-battery-staple"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, list[str], list[dict[str, Any]]]]:
    """A request's identifier, all tokens that were used, and the lines of a server that was asked for much."""
    folder, port = tmp_path_factory.mktemp("logs"), free_port()
    environment = {**os.environ, "TRACEMESH_TOKEN": TOKEN, "TRACEMESH_LOG_FORMAT": "json"}
    command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(port), "--data-dir", str(folder)]
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(command, stderr=log, stdout=subprocess.PIPE, text=True, env=environment)
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Open")
        try:
            with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
                request, tokens = ask_for_much(client, port)
        finally:
            process.terminate()
            process.wait()
            process.stdout.close()
    yield request, tokens, [json.loads(line) for line in Path(folder / "log").read_text().splitlines()]


def ask_for_much(client: httpx.Client, port: int) -> tuple[str, list[str]]:
    """Bring tokens in every way; run a job that fails."""
    owner = {"Authorization": f"Bearer {TOKEN}"}
    client.get("/", params={"token": TOKEN})
    client.get("/api/v1/sessions", params={"token": "a-wrong-token-in-an-address"})
    viewer = client.post("/api/v1/tokens", json={"role": "viewer"}, headers=owner).json()["token"]
    client.get("/api/v1/rights", params={"token": viewer})
    client.get("/api/v1/rights", headers={"Authorization": "Bearer a-wrong-token-in-a-header"})
    with connect(f"ws://127.0.0.1:{port}/api/v1/ingest", additional_headers=owner, open_timeout=60) as device:
        device.send('{"type": "dance", "token": "x"}')
        device.recv(timeout=60)
    session = client.post("/api/v1/sessions", json={}, headers=owner).json()["id"]
    named = client.get(f"/api/v1/sessions/{session}", headers={**owner, "X-Request-ID": "of-the-proxy.1"})
    assert named.headers["X-Request-ID"] == "of-the-proxy.1"
    forged = client.get("/api/v1/sessions", headers={**owner, "X-Request-ID": "no identifier"})
    assert forged.headers["X-Request-ID"] != "no identifier"
    job = client.post(f"/api/v1/sessions/{session}/reconstructions", headers=owner)
    while client.get(job.headers["location"], headers=owner).json()["state"] in ("queued", "running"):
        time.sleep(0.1)
    return job.headers["X-Request-ID"], [TOKEN, viewer, "a-wrong-token", *client.cookies.values()]


def test_every_line_is_an_object_with_time_and_level(written: Any) -> None:
    _, _, lines = written
    assert len(lines) > 10
    assert all({"time", "level", "logger", "message"} <= line.keys() for line in lines)


def test_a_request_is_found_by_the_identifier_that_its_answer_named(written: Any) -> None:
    request, _, lines = written
    (line,) = [line for line in lines if line.get("request") == request]
    assert "POST /api/v1/sessions/" in line["message"]
    assert " 202 " in line["message"]
    assert any(line.get("request") == "of-the-proxy.1" for line in lines)


def test_no_token_is_ever_written(written: Any) -> None:
    _, tokens, lines = written
    text = json.dumps(lines)
    assert len(tokens) >= 4
    assert not any(token in text for token in tokens)
    assert "?" not in "".join(line["message"] for line in lines if "/api/" in line["message"])
