"""Settings: closed by default, and each in the docs."""

import re
from pathlib import Path

import pytest
from pydantic import SecretStr, ValidationError

from tracemesh.errors import InputError
from tracemesh.settings import MIN_TOKEN, Settings

DOCS = Path(__file__).resolve().parents[2] / "docs" / "settings.md"


@pytest.mark.parametrize("name", Settings.model_fields)
def test_every_setting_is_documented_with_its_default(name: str) -> None:
    (row,) = [line for line in DOCS.read_text().splitlines() if f"`TRACEMESH_{name.upper()}`" in line]
    default = Settings.model_fields[name].default
    if isinstance(default, int):
        assert f"`{default}`" in row


def test_the_tables_name_what_a_server_or_the_compose_file_reads_and_nothing_else() -> None:
    documented = re.findall(r"^\| `(TRACEMESH_\w+)`", DOCS.read_text(), re.MULTILINE)
    composed = re.findall(r"\$\{(TRACEMESH_\w+)", (DOCS.parents[1] / "docker-compose.yml").read_text())
    assert sorted(documented) == sorted({*composed, *(f"TRACEMESH_{name.upper()}" for name in Settings.model_fields)})


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "lab.example"])
def test_off_loopback_a_token_is_demanded(host: str) -> None:
    assert Settings(host=host).closed


def test_on_loopback_a_token_is_demanded_when_there_is_one() -> None:
    assert not Settings().closed
    assert Settings(token=SecretStr("x" * MIN_TOKEN)).closed


def test_a_token_that_can_be_guessed_is_refused() -> None:
    with pytest.raises(ValidationError, match="characters"):
        Settings(token=SecretStr("secret"))


def test_the_environment_is_read_and_the_token_never_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRACEMESH_TOKEN", "correct horse battery staple")
    monkeypatch.setenv("TRACEMESH_DATABASE_URL", "postgresql://u:p@db/name")
    settings = Settings()
    assert "horse" not in repr(settings)
    assert settings.resolved_database_url == "postgresql+pg8000://u:p@db/name"


def test_the_file_gives_what_the_environment_and_the_command_line_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "tracemesh.toml"
    monkeypatch.setenv("TRACEMESH_SETTINGS", str(file))
    file.write_text('port = 1\nmax_devices = 2\njob_slots = 3\ndata_dir = "/srv/tracemesh"\n')
    monkeypatch.setenv("TRACEMESH_MAX_DEVICES", "20")
    settings = Settings(port=10)
    assert (settings.port, settings.max_devices, settings.job_slots) == (10, 20, 3)
    assert settings.data_dir == Path("/srv/tracemesh")


@pytest.mark.parametrize(
    ("content", "wanted"),
    [(None, "cannot be read"), ("port = ", "wanted TOML"), ("ports = 8000", "ports"), ("port = 'high'", "port")],
)
def test_a_file_that_cannot_be_right_is_named(
    content: str | None, wanted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "tracemesh.toml"
    if content is not None:
        file.write_text(content)
    monkeypatch.setenv("TRACEMESH_SETTINGS", str(file))
    with pytest.raises((InputError, ValidationError), match=wanted):
        Settings()


@pytest.mark.parametrize("executor", ["", "dask", "dask://", "dask://host", "dask://host:port", "tcp://host:8786"])
def test_an_executor_that_is_none_is_refused(executor: str) -> None:
    with pytest.raises(ValidationError, match="wanted embedded or dask://HOST:PORT"):
        Settings(executor=executor)


def test_workers_elsewhere_do_not_share_a_file() -> None:
    with pytest.raises(ValidationError, match="cannot share an SQLite database"):
        Settings(executor="dask://10.0.0.5:8786")
    assert Settings(executor="dask://localhost:8786").cluster_address == "tcp://localhost:8786"
    assert Settings(executor="dask://10.0.0.5:8786", database_url="postgresql://u@h/d").cluster_address
