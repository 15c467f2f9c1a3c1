"""Network JSON: reading undoes writing bit for bit; every fault is named."""

import json
from pathlib import Path

import numpy as np
import pytest

from tracemesh.errors import InputError
from tracemesh.formats.networks import read_network, write_network

GOOD = {
    "format": "tracemesh-network", "version": 1, "unit": "m",
    "points": [[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], "normals": [[0, 0, 1]] * 3, "nodes": [0, 2],
    "segments": [{"points": [0, 1, 2], "boundary": True, "curve": 3}],
}  # fmt: skip


def test_reading_undoes_writing_bit_for_bit(shared_data: Path) -> None:
    for file in sorted((shared_data / "networks").glob("*.json")):
        network = read_network(file.read_text())
        again = read_network(write_network(network))
        assert again.points.tobytes() == network.points.tobytes()
        assert again.normals.tobytes() == network.normals.tobytes()
        assert again.nodes.tolist() == network.nodes.tolist()
        for one, two in zip(network.segments, again.segments, strict=True):
            assert (one.points.tolist(), one.boundary, one.curve) == (two.points.tolist(), two.boundary, two.curve)


def test_reads_what_is_written_by_hand() -> None:
    network = read_network(json.dumps(GOOD))
    assert network.points.dtype == np.float64
    assert network.segments[0].points.tolist() == [0, 1, 2]
    assert (network.segments[0].boundary, network.segments[0].curve) == (True, 3)


def test_uncertainty_may_be_missing_and_is_kept_where_it_is_known() -> None:
    assert read_network(json.dumps(GOOD)).uncertainty is None
    assert read_network(json.dumps(GOOD | {"uncertainty": [0.1, 0.1]})).uncertainty is None
    assert "uncertainty" not in json.loads(write_network(read_network(json.dumps(GOOD))))
    known = read_network(json.dumps(GOOD | {"uncertainty": [0.001, 0.1 + 0.2, 0]}))
    assert known.uncertainty is not None
    again = read_network(write_network(known)).uncertainty
    assert again is not None
    assert again.tobytes() == known.uncertainty.tobytes()


FAULTS: list[tuple[dict[str, object], str]] = [
    ({"format": "gltf"}, "format"),
    ({"version": 2}, "version"),
    ({"unit": "mm"}, "unit"),
    ({"points": [[0, 0, 0], [0, 1], [1, 0, 0]]}, r"points\.1"),
    ({"points": [[0, 0, 0], [0, "x", 0], [1, 0, 0]]}, r"points\.1\.1.*'x'"),
    ({"normals": [[0, 0, 1]] * 2}, "each of the 3 points, got 2"),
    ({"normals": [[0, 0, 1], [0, 0, 1], [0, 0, 2]]}, r"normals\[2\].*length 1"),
    ({"uncertainty": [0.1, -0.1, 0]}, r"uncertainty\.1: .*greater than or equal to 0, got '-0\.1"),
    ({"nodes": [0, 3]}, r"nodes\[1\].*from 0 to 2, got 3"),
    ({"nodes": [0, 0, 2]}, "every node once"),
    ({"segments": []}, "segments"),
    ({"segments": [{"points": [0, -1, 2]}]}, r"segments\[0\]\.points\[1\].*got -1"),
    ({"segments": [{"points": [0, 0, 2]}]}, "same point twice"),
    ({"segments": [{"points": [0, 1]}]}, "a node at both ends, got 0 and 1"),
]


@pytest.mark.parametrize(("change", "message"), FAULTS)
def test_every_fault_is_named(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_network(json.dumps(GOOD | change), "a.network.json")
    assert str(caught.value).startswith("a.network.json: ")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"format": NaN}', "\x00"])
def test_what_is_no_network_at_all_is_an_input_error(text: str) -> None:
    with pytest.raises(InputError):
        read_network(text)


def test_a_closed_curve_without_nodes_needs_none() -> None:
    network = read_network(json.dumps(GOOD | {"nodes": [], "segments": [{"points": [0, 1, 2, 0]}]}))
    assert network.segments[0].points.tolist() == [0, 1, 2, 0]
