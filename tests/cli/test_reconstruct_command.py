"""`tracemesh reconstruct`, `surface` and `evaluate` as a stranger runs them: real files, and real processes."""

import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tracemesh.cli import main
from tracemesh.formats.meshes import write_triangles


def tracemesh(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command within this process: a new one costs two seconds of imports."""
    command = list(map(str, arguments))
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err, pytest.raises(SystemExit) as end:
        main(command)
    assert isinstance(end.value.code, int)
    return subprocess.CompletedProcess(command, end.value.code, out.getvalue(), err.getvalue())


def tracemesh_process(*arguments: object, stdin: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command as a process of its own."""
    command = [sys.executable, "-m", "tracemesh", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, input=stdin, timeout=120)


@pytest.fixture(scope="module")
def lilium(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The thesis author's own network, reconstructed into a folder."""
    folder = tmp_path_factory.mktemp("lilium")
    done = tracemesh_process(
        "reconstruct",
        *(shared_data / "lilium.rawnet", "-o", folder / "lilium.glb"),
        *("--network", folder / "network.json", "--report", folder / "report.json"),
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    return folder


def test_the_network_is_on_the_true_surface(lilium: Path, shared_data: Path) -> None:
    truth = shared_data / "lilium.obj"
    done = tracemesh("evaluate", lilium / "network.json", "--truth", truth, "--align", "rigid", "--json")
    measured = json.loads(done.stdout)
    assert measured["unit"] == "percent of the truth's diagonal"
    assert measured["mean"] <= 0.02
    assert measured["min"] <= measured["mean"] <= measured["rms"] <= measured["max"]


def test_the_mesh_is_one_oriented_disk(lilium: Path) -> None:
    mesh = trimesh.load(lilium / "lilium.glb", force="mesh", process=True)
    edges, count = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)
    assert count.max() == 2
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 1
    rim = edges[count == 1]
    assert (np.unique(rim, return_counts=True)[1] == 2).all()
    loops = trimesh.graph.connected_components(rim)
    assert len(loops) == 1


def test_the_prefilter_is_as_wide_as_wanted(lilium: Path, shared_data: Path, tmp_path: Path) -> None:
    automatic = json.loads((lilium / "report.json").read_text())["network"]["parameters"]
    assert automatic["prefilter_m"] == automatic["step_m"] / 2
    command = ("reconstruct", shared_data / "lilium.rawnet", "-o", tmp_path / "no.glb", "--no-surface")
    wanted = 2 * automatic["step_m"]
    done = tracemesh(*command, "--prefilter", wanted, "--report", tmp_path / "report.json")
    assert done.returncode == 0, done.stderr
    used = json.loads((tmp_path / "report.json").read_text())["network"]["parameters"]
    assert used == automatic | {"prefilter_m": wanted} | {k: used[k] for k in ("stretch_m", "bend_m")}
    for wrong in ("0", "-1", "nan"):
        done = tracemesh(*command, "--prefilter", wrong)
        assert done.returncode == 2
        assert "prefilter" in done.stderr
        assert "Traceback" not in done.stderr


def test_the_report_says_what_was_used(lilium: Path) -> None:
    report = json.loads((lilium / "report.json").read_text())
    assert report["generator"].startswith("tracemesh ")
    assert report["seconds"] > 0
    assert report["network"]["parameters"]["step_m"] > 0
    assert report["surface"]["euler_number"] == 1


def without_unused_points(network: dict[str, Any]) -> dict[str, Any]:
    """The network JSON with only the points that its segments still have."""
    used = sorted({p for s in network["segments"] for p in s["points"]})
    number = {p: k for k, p in enumerate(used)}
    for segment in network["segments"]:
        segment["points"] = [number[p] for p in segment["points"]]
    kept = {name: [network[name][p] for p in used] for name in ("points", "normals")}
    return {**network, **kept, "nodes": [number[p] for p in network["nodes"]]}


@pytest.mark.parametrize("align", ["none", "rigid"])
def test_looking_both_ways_sees_what_is_missing(lilium: Path, tmp_path: Path, align: str) -> None:
    """A square and its left half, cut off at x = .5: no vertex of the half is off, and (1, y) is .5 from it."""
    side = np.linspace(0, 1, 11)
    vertices = np.column_stack([*(axis.ravel() for axis in np.meshgrid(side, side)), np.zeros(121)])
    grid = np.arange(121).reshape(11, 11)
    a, b, c, d = (corner.ravel() for corner in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]))
    faces = np.vstack([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    left = faces[(vertices[faces][:, :, 0] < 0.51).all(1)]
    for name, part in (("whole.obj", faces), ("half.obj", left)):
        (tmp_path / name).write_bytes(write_triangles(vertices, part, "obj"))
    options = ("--truth", tmp_path / "whole.obj", "--align", align, "--both-ways")
    found = json.loads(tracemesh("evaluate", tmp_path / "half.obj", *options, "--json").stdout)
    assert (found["max"], found["hausdorff"]) == pytest.approx((0.0, 50 / np.sqrt(2)), abs=1e-6)
    assert "35.3553 % (Hausdorff distance)" in tracemesh("evaluate", tmp_path / "half.obj", *options).stdout
    refused = tracemesh("evaluate", lilium / "network.json", *options)
    assert (refused.returncode, "wanted a mesh" in refused.stderr) == (1, True)


def test_an_uneven_network_is_resampled_first(lilium: Path, tmp_path: Path) -> None:
    """Of the network's points between nodes one in three is kept; splines give back the surface of all of them."""
    network = json.loads((lilium / "network.json").read_text())
    for segment in network["segments"]:
        points = segment["points"]
        segment["points"] = [p for k, p in enumerate(points) if k % 3 == 1 or k in (0, len(points) - 1)]
    uneven = tmp_path / "uneven.json"
    uneven.write_text(json.dumps(without_unused_points(network)))
    errors = []
    for name, options in (("as-is.obj", ()), ("even.obj", ("--resample", 0.015))):
        done = tracemesh("surface", uneven, "-o", tmp_path / name, *options)
        assert done.returncode == 0, done.stderr
        whole = ("--truth", lilium / "lilium.glb", "--json")
        errors.append(json.loads(tracemesh("evaluate", tmp_path / name, *whole).stdout)["mean"])
    assert errors[1] < errors[0]


@pytest.mark.parametrize("step", ["0", "nan", "1e-12"])
def test_a_step_that_cannot_be_is_refused(lilium: Path, tmp_path: Path, step: str) -> None:
    done = tracemesh("surface", lilium / "network.json", "-o", tmp_path / "mesh.obj", f"--resample={step}")
    assert done.returncode == 1
    assert "tracemesh: " in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("extension", ["obj", "ply", "stl"])
def test_every_mesh_format_holds_the_same_surface(lilium: Path, extension: str, tmp_path: Path) -> None:
    done = tracemesh("surface", lilium / "network.json", "-o", tmp_path / f"mesh.{extension}")
    assert done.returncode == 0, done.stderr
    written = trimesh.load(tmp_path / f"mesh.{extension}", force="mesh")
    glb = trimesh.load(lilium / "lilium.glb", force="mesh")
    z_up = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert written.area == pytest.approx(glb.area, rel=1e-5)
    np.testing.assert_allclose(written.bounds, np.sort(glb.bounds @ z_up.T, axis=0), atol=1e-5)


@pytest.mark.parametrize("name", ["sphere", "torus", "cone", "bumpy", "lilium", "lilium7"])
def test_a_noisy_scan_becomes_a_surface(shared_data: Path, tmp_path: Path, name: str) -> None:
    done = tracemesh("reconstruct", shared_data / f"scans/{name}-noisy.rawnet", "-o", tmp_path / "mesh.glb")
    assert done.returncode == 0, done.stderr
    mesh = trimesh.load(tmp_path / "mesh.glb", force="mesh", process=True)
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 1


def test_standard_input_and_a_network_only(shared_data: Path, tmp_path: Path) -> None:
    text = (shared_data / "lilium.rawnet").read_text()
    output = ("-o", tmp_path / "no.glb", "--network", tmp_path / "network.json")
    done = tracemesh_process("reconstruct", "-", *output, "--no-surface", stdin=text)
    assert done.returncode == 0, done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["network.json"]


def test_a_robust_loss_bears_frames_that_are_pure_chance(shared_data: Path, tmp_path: Path) -> None:
    lines = (shared_data / "lilium.rawnet").read_text().splitlines()
    rows = [k for k, line in enumerate(lines) if len(line.split()) == 7]
    for k in rows[5::20]:
        lines[k] = f"{lines[k].split()[0]} 0.6 0.8 0 -0.8 0.6 0"
    output = ("-o", tmp_path / "no.glb", "--report", tmp_path / "report.json", "--no-surface", "--robust")
    done = tracemesh_process("reconstruct", "-", *output, stdin="\n".join(lines))
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "report.json").read_text())["network"]["parameters"]["robust"] is True


def lilium_with(change: str, text: str) -> str:
    """The author's file with one fault."""
    lines = text.splitlines()
    row = next(i for i, line in enumerate(lines) if len(line.split()) == 7)
    match change:
        case "truncated":
            return "\n".join(lines[: row + 20])
        case "letter":
            lines[row + 4] = lines[row + 4].replace("0.", "0x", 1)
        case "node index":
            lines[4] = lines[4].replace("187", "9187")
        case "not finite":
            lines[row + 4] = " ".join(["nan", *lines[row + 4].split()[1:]])
        case "two pieces":
            lines = _renumber_second_curve(lines)
        case "not closed":
            lines[5] = lines[5].replace("0 4 1 2 0", "0 4 1 2 3")
    return "\n".join(lines)


def _renumber_second_curve(lines: list[str]) -> list[str]:
    """Give the curves after the first one nodes that the first one does not have."""
    headers = [i for i, line in enumerate(lines) if len(line.split()) != 7]
    for start in (i for i in headers[6:] if i + 3 in headers and lines[i] in ("0", "1") and lines[i + 1] in ("0", "1")):
        lines[start + 4] = " ".join(str(int(n) + 100) for n in lines[start + 4].split())
    return lines


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        ("truncated", ["line", "curve 1"]),
        ("letter", ["line", "curve 1"]),
        ("node index", ["line 5", "curve 1", "9187"]),
        ("not finite", ["line", "curve 1", "nan"]),
        ("two pieces", ["curve"]),
        ("not closed", ["curve 1", "closed"]),
    ],
)
def test_a_wrong_rawnet_is_refused_with_its_place_and_nothing_is_written(
    change: str, wanted: list[str], shared_data: Path, tmp_path: Path
) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    scan = tmp_path / "in" / "wrong.rawnet"
    scan.write_text(lilium_with(change, (shared_data / "lilium.rawnet").read_text()))
    out = tmp_path / "out"
    done = tracemesh("reconstruct", scan, "-o", out / "m.glb", "--network", out / "n.json", "--report", out / "r.json")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert [word for word in wanted if word not in done.stderr] == []
    assert list(out.iterdir()) == []


def test_usage_errors_exit_with_two(tmp_path: Path) -> None:
    assert tracemesh("reconstruct", "scan.rawnet", "-o", "mesh.txt").returncode == 2
    assert tracemesh("reconstruct", "scan.rawnet", "-o", "m.glb", "--step", "wide").returncode == 2
    assert tracemesh().returncode == 2


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    done = tracemesh_process("reconstruct", tmp_path / "none.rawnet", "-o", tmp_path / "m.glb")
    assert done.returncode == 1
    assert "none.rawnet" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_mesh_size_is_chosen_apart_from_the_step(lilium: Path, tmp_path: Path) -> None:
    network, mesh = lilium / "network.json", tmp_path / "mesh.ply"
    edges = []
    for size in ("3%", "0.8%"):
        done = tracemesh("surface", network, "-o", mesh, "--mesh-size", size)
        assert done.returncode == 0, done.stderr
        found = trimesh.load_mesh(mesh)
        diagonal = np.linalg.norm(np.ptp(json.loads(network.read_text())["points"], axis=0))
        edges.append(np.median(found.edges_unique_length) / diagonal)
        assert found.euler_number == 1
    assert edges[1] == pytest.approx(0.008, rel=0.4)
    assert edges[0] > 1.5 * edges[1]
    for wrong, status, words in (("0.0001%", 1, "mesh size of at least"), ("fine", 2, "such as 0.8% or")):
        done = tracemesh("surface", network, "-o", tmp_path / "none.ply", "--mesh-size", wrong)
        assert (done.returncode, words in done.stderr) == (status, True), done.stderr
    assert not (tmp_path / "none.ply").exists()
