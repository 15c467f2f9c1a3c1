"""What a list shows of a session: few points, where the session's own curves are."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracemesh.api.outline import MOST_POINTS
from tracemesh.formats.networks import read_network
from tracemesh.geometry.scan import Floats


def points(outline: dict[str, Any]) -> Floats:
    lines = [np.reshape(curve["positions"], (-1, 3)) for curve in outline["curves"]]
    assert all(len(line) <= MOST_POINTS for line in lines)
    return np.concatenate(lines)


def test_it_is_empty_then_reckoned_then_reconstructed(server: Any, shared_data: Path) -> None:
    session = server.new_session()
    assert server.http.get(f"/sessions/{session}/outline").json() == {"curves": []}

    content = (shared_data / "lilium.rawnet").read_bytes()
    server.http.post(f"/sessions/{session}/recordings", content=content)
    reckoned = server.http.get(f"/sessions/{session}/outline").json()
    assert [curve["boundary"] for curve in reckoned["curves"]] == [True, False, False]

    job = server.http.post(f"/sessions/{session}/reconstructions", json={"surface": False}).json()
    while job["state"] in ("queued", "running"):
        time.sleep(0.05)
        job = server.http.get(f"/reconstructions/{job['id']}").json()
    network = read_network(server.http.get(f"/reconstructions/{job['id']}/network.json").text)
    reconstructed = points(server.http.get(f"/sessions/{session}/outline").json())
    nearest = np.linalg.norm(network.points[:, None] - reconstructed, axis=2).min(axis=0)
    assert nearest.max() < 2e-5
    assert np.ptp(reconstructed, axis=0) == pytest.approx(np.ptp(points(reckoned), axis=0), rel=0.1)


def test_a_session_that_is_not_there_has_none(server: Any) -> None:
    assert server.http.get("/sessions/nowhere/outline").status_code == 404
