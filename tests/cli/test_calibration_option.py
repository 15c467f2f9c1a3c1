"""`tracemesh reconstruct --calibration`: an old recording, new orientations."""

import json
from pathlib import Path

import pytest

from tracemesh.cli import main


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    assert isinstance(end.value.code, int)
    return end.value.code


def calibration(folder: Path, **change: object) -> Path:
    path = folder / "cal.json"
    path.write_text(json.dumps({"device": "simulated", "made": "2026-05-03T10:00:00Z", "circumference": 0.2, **change}))
    return path


def test_a_wheel_of_twice_the_size_makes_everything_twice_as_large(tmp_path: Path) -> None:
    scan = tmp_path / "leaf.ndjson"
    assert run("simulate", "leaf", "-o", tmp_path / "leaf.rawnet", "--recording", scan, "--noise", 0) == 0
    lengths, used = [], []
    for options in ((), ("--calibration", calibration(tmp_path))):
        files = ("-o", tmp_path / "m.obj", "--no-surface", "--report", tmp_path / "report.json")
        assert run("reconstruct", scan, *files, "--step", "4%", *options) == 0
        report = json.loads((tmp_path / "report.json").read_text())
        lengths.append(report["network"]["sizes"]["diagonal_m"])
        used.append(report["calibrations"])
    assert lengths[1] == pytest.approx(2 * lengths[0], rel=1e-6)
    assert [len(u) for u in used] == [0, 1]
    assert used[1][0]["calibration"] == "calibration of simulated, 2026-05-03"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"device": "other"}, "wanted a calibration of the device simulated, got one of other"),
        ({"circumference": -1}, "cal.json: circumference: wanted a calibration"),
    ],
)
def test_what_makes_no_sense_is_said(
    change: dict[str, object], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan = tmp_path / "leaf.ndjson"
    run("simulate", "leaf", "-o", tmp_path / "leaf.rawnet", "--recording", scan)
    options = ("--calibration", calibration(tmp_path, **change))
    assert run("reconstruct", scan, "-o", tmp_path / "m.obj", *options) == 1
    assert words in capsys.readouterr().err
