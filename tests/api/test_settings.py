"""Settings: closed by default, and each in the docs."""

from pathlib import Path

import pytest
from pydantic import SecretStr, ValidationError

from tracemesh.settings import MIN_TOKEN, Settings

DOCS = Path(__file__).resolve().parents[2] / "docs" / "settings.md"


@pytest.mark.parametrize("name", Settings.model_fields)
def test_every_setting_is_documented_with_its_default(name: str) -> None:
    (row,) = [line for line in DOCS.read_text().splitlines() if f"`TRACEMESH_{name.upper()}`" in line]
    default = Settings.model_fields[name].default
    if isinstance(default, int):
        assert f"`{default}`" in row


def test_no_setting_is_documented_that_does_not_exist() -> None:
    rows = [line for line in DOCS.read_text().splitlines() if line.startswith("| `TRACEMESH_")]
    assert len(rows) == len(Settings.model_fields)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "lab.example"])
def test_off_loopback_it_does_not_start_without_a_token(host: str) -> None:
    with pytest.raises(ValidationError, match="TRACEMESH_TOKEN"):
        Settings(host=host)
    assert Settings(host=host, token=SecretStr("x" * MIN_TOKEN)).host == host


def test_a_token_that_can_be_guessed_is_refused() -> None:
    with pytest.raises(ValidationError, match="characters"):
        Settings(token=SecretStr("secret"))


def test_the_environment_is_read_and_the_token_never_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRACEMESH_TOKEN", "correct horse battery staple")
    monkeypatch.setenv("TRACEMESH_DATABASE_URL", "postgresql://u:p@db/name")
    settings = Settings()
    assert "horse" not in repr(settings)
    assert settings.resolved_database_url == "postgresql+pg8000://u:p@db/name"
