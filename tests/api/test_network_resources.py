"""Nodes and segments of the latest network."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracemesh.formats.networks import read_network


def test_nodes_and_segments_are_those_of_the_latest_network(server: Any, shared_data: Path) -> None:
    session = server.new_session()
    assert server.http.get(f"/sessions/{session}/nodes").status_code == 404
    server.http.post(f"/sessions/{session}/recordings", content=(shared_data / "lilium.rawnet").read_bytes())
    job = server.http.post(f"/sessions/{session}/reconstructions", json={"step": "3%"}).json()
    while (job := server.http.get(f"/reconstructions/{job['id']}").json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    network = read_network(server.http.get(f"/reconstructions/{job['id']}/network.json").text)
    nodes = server.http.get(f"/sessions/{session}/nodes").json()
    assert [n["position"] for n in nodes] == network.points[network.nodes].tolist()
    assert [n["normal"] for n in nodes] == network.normals[network.nodes].tolist()
    segments, path = [], f"/sessions/{session}/segments?limit=2"
    while path:
        page = server.http.get(path)
        segments += page.json()
        path = page.headers.get("link", "").partition(">")[0].removeprefix("</api/v1")
    assert [s["index"] for s in segments] == list(range(len(network.segments)))
    for known, segment in zip(network.segments, segments, strict=True):
        points = network.points[known.points]
        assert segment["length"] == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        assert [network.nodes[n] for n in segment["nodes"]] == [known.points[0], known.points[-1]]
        assert all(segment["index"] in nodes[n]["segments"] for n in segment["nodes"])
    assert server.http.get(f"/sessions/{session}/nodes?after=x").status_code == 422
