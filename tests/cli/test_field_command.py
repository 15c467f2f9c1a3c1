"""`tracemesh reconstruct --place` and `--still`: the result stands upright in the field of its place."""

import json
from pathlib import Path

import numpy as np
import pytest

from tracemesh.cli import main
from tracemesh.formats.networks import read_network
from tracemesh.geometry.simulated.shapes import SHAPES


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    assert isinstance(end.value.code, int)
    return end.value.code


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an exact device sends of a leaf, in the thesis's field (inclination 60 degrees)."""
    folder = tmp_path_factory.mktemp("leaf")
    path = folder / "leaf.ndjson"
    assert "leaf" in SHAPES
    assert run("simulate", "leaf", "-o", folder / "leaf.rawnet", "--recording", path, "--noise", 0) == 0
    return path


def network(recording: Path, folder: Path, *options: str) -> tuple[int, np.ndarray]:
    path = folder / "net.json"
    status = run(
        "reconstruct", recording, "-o", folder / "m.obj", "--no-surface", "--network", path, "--step", 0.02, *options
    )
    return status, read_network(path.read_text()).normals if status == 0 else np.empty((0, 3))


def still(recording: Path, folder: Path) -> Path:
    """The device lay still where the recording began."""
    hello, start, samples = (json.loads(line) for line in recording.read_text().splitlines()[:3])
    first = {k: [samples[k][0]] * 20 for k in ("acceleration", "magnetic", "time")}
    messages = [hello, start, {"type": "samples", "seq": 1, "curve": 0, "first_sample": 0, **first}]
    path = folder / "still.ndjson"
    path.write_text("".join(json.dumps(m) + "\n" for m in messages))
    return path


def test_the_field_of_a_place_tilts_everything_alike(recording: Path, tmp_path: Path) -> None:
    _, named = network(recording, tmp_path)
    _, placed = network(recording, tmp_path, "--place=-33.9,151.2", "--date", "2026-11-22")
    assert np.abs(placed - named).max() > 0.1
    np.testing.assert_allclose(placed @ placed.T, named @ named.T, atol=1e-3)


def test_the_field_measured_at_rest_is_the_one_that_the_recording_names(recording: Path, tmp_path: Path) -> None:
    _, named = network(recording, tmp_path)
    status, measured = network(recording, tmp_path, "--still", str(still(recording, tmp_path)))
    assert status == 0
    quarter_turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # x to North becomes y to North
    np.testing.assert_allclose(measured, named @ quarter_turn.T, atol=0.01)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--date", "2026-11-22"], "no --place"),
        (["--place", "95,0"], "latitude"),
        (["--place", "45,6", "--date", "1999-01-01"], "2015 to 2029"),
    ],
)
def test_what_makes_no_sense_is_said(
    options: list[str], words: str, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert network(recording, tmp_path, *options)[0] == 1
    assert words in capsys.readouterr().err


def test_a_rawnet_has_no_vectors(shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert network(shared_data / "lilium.rawnet", tmp_path, "--place", "45,6")[0] == 1
    assert "wanted a recording" in capsys.readouterr().err


@pytest.mark.parametrize("options", [["--place", "here"], ["--date", "today"], ["--place", "45,6", "--still", "x"]])
def test_usage(options: list[str], recording: Path, tmp_path: Path) -> None:
    assert network(recording, tmp_path, *options)[0] == 2
