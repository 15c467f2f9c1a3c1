"""What a person gets wrong on the bridge's command line: a line that says what was wanted, and no traceback."""

from pathlib import Path

import pytest

from tracemesh_bridge.cli import main


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["morphorider", "--port", "x", "--name", "a\x01b"], "none of them a control character"),
        (["morphorider", "--port", "x", "--name", "n" * 201], "up to 200 characters"),
        (["inspect", "--port", "x", "--count", "0"], "a whole number from 1 up, got '0'"),
        (["sensorlogger", "--port", "99999"], "a port from 0 to 65535, got '99999'"),
        (["virtual", "--seed", "-1"], "a whole number from 0 up, got '-1'"),
        (["virtual", "--short", "2"], "a probability from 0 to 1, got '2'"),
        (["virtual-phone", "--app", "sensorlogger", "--url", "phone"], "an address such as"),
    ],
)
def test_a_value_that_cannot_be_is_refused_where_it_is_typed(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as refused:
        main(arguments)
    assert refused.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("server", ["ftp://host", "http://", "http://host:99999", "http://[::1"])
def test_an_address_that_is_none_is_refused(server: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["morphorider", "--port", "x", "--spool", str(tmp_path), "--server", server]) == 1
    assert f"wanted a server's address such as http://127.0.0.1:8000, got {server!r}" in capsys.readouterr().err


def test_a_spool_that_is_a_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.write_text("content")
    assert main(["morphorider", "--port", "x", "--spool", str(file)]) == 1
    assert f"cannot use {file} as a spool" in capsys.readouterr().err


def test_the_virtual_devices_link_never_replaces_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.write_text("content")
    assert main(["virtual", "--link", str(file)]) == 1
    assert "is no link" in capsys.readouterr().err
    assert file.read_text() == "content"
