"""A recording with times instead of lengths: the result says what its size is worth, and takes a measured length."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracemesh.cli import main
from tracemesh.formats.networks import read_network
from tracemesh.formats.rawnet import read_rawnet


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    assert isinstance(end.value.code, int)
    return end.value.code


@pytest.fixture
def sketch(tmp_path: Path) -> Path:
    """The leaf as a device without a wheel sends it; beside it the same with its wheel, as leaf.rawnet."""
    path = tmp_path / "leaf.ndjson"
    assert run("simulate", "leaf", "-o", tmp_path / "leaf.rawnet", "--recording", path, "--noise", 0) == 0
    messages = [json.loads(line) for line in path.read_text().splitlines()]
    for message in messages:
        message.pop("ticks", None)
    path.write_text("".join(json.dumps(m) + "\n" for m in messages))
    return path


def reconstructed(folder: Path, scan: Path, *options: str) -> tuple[float, dict[str, list[Any]]]:
    """Diagonal of the network, m, and what the report says of lengths."""
    net, report = folder / "net.json", folder / "report.json"
    outputs = ("-o", folder / "m.obj", "--no-surface", "--network", net, "--report", report)
    assert run("reconstruct", scan, *outputs, *options) == 0
    return read_network(net.read_text()).diagonal, json.loads(report.read_text())["lengths"]


def test_without_any_length_it_warns_and_with_one_it_has_the_right_size(
    sketch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    true, said = reconstructed(tmp_path, tmp_path / "leaf.rawnet")
    assert said == {"timed_curves": [], "pauses_s": [], "curves_with_given_lengths": [], "warnings": []}
    assert "warning" not in capsys.readouterr().err

    timed, said = reconstructed(tmp_path, sketch)
    everything = list(range(len(read_rawnet((tmp_path / "leaf.rawnet").read_text()).curves)))
    assert (said["timed_curves"], len(said["warnings"])) == (everything, 1)
    assert all(3.0 < pause < 20.0 for pause in said["pauses_s"]), "a second at each node, before and after"
    assert "warning: no length was measured" in capsys.readouterr().err
    assert timed != pytest.approx(true, rel=0.03)

    curve = read_rawnet((tmp_path / "leaf.rawnet").read_text()).curves[1]
    length = float(np.diff(curve.distance[curve.node_samples])[0])
    measured, said = reconstructed(tmp_path, sketch, "--length", f"2:1={length}")
    assert (said["timed_curves"], said["curves_with_given_lengths"], said["warnings"]) == (everything, [1], [])
    assert measured == pytest.approx(true, rel=0.03)


@pytest.mark.parametrize("length", ["2:1", "2=1.0", "0:1=1.0", "a:b=c"])
def test_what_is_no_length_is_usage(length: str, tmp_path: Path) -> None:
    assert run("reconstruct", "none.rawnet", "-o", tmp_path / "m.obj", "--length", length) == 2


def test_a_segment_that_is_not_there_is_named(sketch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("reconstruct", sketch, "-o", tmp_path / "m.obj", "--length", "1:99=0.5") == 1
    assert "segment 99 of curve 1" in capsys.readouterr().err
