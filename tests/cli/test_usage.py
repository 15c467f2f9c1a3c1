"""What a person gets wrong on the command line: a line that says what was wanted, and no traceback."""

from pathlib import Path

import pytest

from tracemesh.cli import main

SIMULATE = ["simulate", "leaf", "-o"]
RECONSTRUCT = ["reconstruct", "scan.rawnet", "-o", "mesh.glb"]


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = str(tmp_path_factory.mktemp("scan") / "leaf.rawnet")
    assert _status([*SIMULATE, path]) == 0
    return path


def _status(arguments: list[str]) -> object:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([*SIMULATE, "x.rawnet", "--noise", "-1"], "a number from 0 to 1, got '-1'"),
        ([*SIMULATE, "x.rawnet", "--noise", "nan"], "a number from 0 to 1, got 'nan'"),
        ([*SIMULATE, "x.rawnet", "--seed", "-1"], "a whole number from 0 up, got '-1'"),
        ([*RECONSTRUCT, "--step", "wide"], "such as 1.6% or metres such as 0.01, got 'wide'"),
        ([*RECONSTRUCT, "--length", "1:2"], "CURVE:SEGMENT=METRES"),
        ([*RECONSTRUCT, "--length", "0:1=1"], "both counted from 1"),
        ([*RECONSTRUCT, "--place", "45"], "latitude and longitude"),
        ([*RECONSTRUCT, "--date", "today"], "a date such as"),
        (["serve", "--port", "99999"], "a port from 0 to 65535, got '99999'"),
        (["demo", "--headless"], "--headless and --out DIR need each other"),
        (["demo", "--out", "somewhere"], "--headless and --out DIR need each other"),
    ],
)
def test_a_value_that_cannot_be_is_refused_where_it_is_typed(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _status(arguments) == 2
    assert words in capsys.readouterr().err


def test_a_folder_that_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _status([*SIMULATE, str(tmp_path / "none" / "x.rawnet")]) == 1
    assert f"there is no folder {tmp_path / 'none'}" in capsys.readouterr().err


def test_a_folder_in_place_of_a_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _status([*SIMULATE, str(tmp_path)]) == 1
    assert f"{tmp_path}: cannot be written" in capsys.readouterr().err


def test_two_results_never_share_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "x.obj")
    assert _status([*SIMULATE, path, "--truth", path]) == 1
    assert "a file of its own for each result" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_step_longer_than_the_curves_is_refused(
    scan: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _status(["reconstruct", scan, "-o", str(tmp_path / "x.glb"), "--step", "500"]) == 1
    assert "a step of 500 m is longer than all curves together" in capsys.readouterr().err
