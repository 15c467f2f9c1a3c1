"""`tracemesh reconstruct --infer-nodes`: scans without marks become surfaces; what was found is said."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tracemesh.cli import main
from tracemesh.formats.rawnet import read_rawnet, write_rawnet
from tracemesh.geometry.scan import CurveScan, Scan


def unmarked(curve: CurveScan) -> CurveScan:
    none = np.empty(0, np.int64)
    return replace(curve, node_samples=none, node_ids=none)


@pytest.fixture
def scan(shared_data: Path, tmp_path: Path) -> Path:
    """A noisy scan of the lilium, of which nobody marked the nodes."""
    marked = read_rawnet((shared_data / "scans/lilium-noisy.rawnet").read_text())
    path = tmp_path / "unmarked.rawnet"
    path.write_text(write_rawnet(Scan(tuple(map(unmarked, marked.curves)))))
    return path


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    assert isinstance(end.value.code, int)
    return end.value.code


def test_without_the_flag_the_error_names_pieces_and_flag(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("reconstruct", scan, "-o", tmp_path / "mesh.obj") == 1
    said = capsys.readouterr().err
    assert [word for word in ("pieces", "(curve 1)", "--infer-nodes") if word not in said] == []
    assert not (tmp_path / "mesh.obj").exists()


def test_the_mesh_is_as_near_to_the_truth_as_with_marks(
    scan: Path, shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = shared_data / "lilium.obj"
    errors = []
    for source, options in ((scan, ["--infer-nodes"]), (shared_data / "scans/lilium-noisy.rawnet", [])):
        mesh = tmp_path / "mesh.obj"
        assert run("reconstruct", source, "-o", mesh, "--report", tmp_path / "report.json", *options) == 0
        assert ("12 nodes, 0 of them marked, 12 found" in capsys.readouterr().err) == bool(options)
        assert run("evaluate", mesh, "--truth", truth, "--align", "similarity", "--json") == 0
        errors.append(json.loads(capsys.readouterr().out))
        nodes = json.loads((tmp_path / "report.json").read_text()).get("nodes")
        assert (nodes is not None) == bool(options)
    assert errors[0]["mean"] <= 1.5 * errors[1]["mean"]
    assert errors[0]["normal_deg"] <= 1.5 * errors[1]["normal_deg"] < 10


def test_the_report_holds_every_proposal(scan: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    assert run("reconstruct", scan, "-o", tmp_path / "m.obj", "--no-surface", "--report", report, "--infer-nodes") == 0
    nodes = json.loads(report.read_text())["nodes"]
    curves = read_rawnet(scan.read_text()).curves
    assert len(nodes["proposals"]) == 12
    for proposal in nodes["proposals"]:
        assert len(proposal["places"]) == 2
        assert all(p["sample"] < len(curves[p["curve"]].distance) for p in proposal["places"])
        assert proposal["used"] == (proposal["confidence"] > nodes["least_confidence"])
        assert not proposal["marked"]


def test_a_curve_without_a_place_is_named(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = read_rawnet(scan.read_text())
    count = np.arange(100.0)
    upside_down = np.tile([0.0, 0.0, -1.0], (100, 1))
    straight = CurveScan(0.05 * count, np.tile([1.0, 0.0, 0.0], (100, 1)), upside_down)
    scan.write_text(write_rawnet(Scan((*found.curves, straight))))
    assert run("reconstruct", scan, "-o", tmp_path / "mesh.obj", "--infer-nodes") == 1
    assert f"no place was found for curve {len(found.curves) + 1}:" in capsys.readouterr().err
