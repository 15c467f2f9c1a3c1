"""Settings of the service: one frozen object, from `TRACEMESH_...` variables and a file; listed in docs/settings.md."""

import os
import re
import tomllib
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

from platformdirs import user_data_path
from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, InitSettingsSource, PydanticBaseSettingsSource, SettingsConfigDict

from tracemesh.errors import InputError
from tracemesh.logs import LogFormat

LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})
"""Hosts that only this machine reaches."""
FILE_VARIABLE = "TRACEMESH_SETTINGS"
"""Names the settings file, if there is one."""
MIN_TOKEN = 16
"""Fewest characters of a token: shorter ones can be guessed."""


class Settings(BaseSettings):
    """How one server runs. Closed by default: any address but loopback demands a token."""

    model_config = SettingsConfigDict(env_prefix="TRACEMESH_", frozen=True, extra="forbid")

    host: str = Field(default="127.0.0.1", description="address to listen on")
    port: int = Field(default=8000, ge=0, le=65535, description="port to listen on; 0 takes a free one")
    lan: bool = Field(default=False, description="serve the local network over HTTPS, with an authority of its own")
    data_dir: Path = Field(
        default_factory=lambda: user_data_path("tracemesh"), description="folder of the database and the artifacts"
    )
    database_url: str = Field(
        default="",
        description="postgresql://user:password@host/name; empty: SQLite in the data folder",
    )
    artifact_bucket: str = Field(
        default="", description="s3://bucket/prefix for meshes and reports; empty: a folder in the data folder"
    )
    token: SecretStr | None = Field(default=None, description=f"token of the owner, {MIN_TOKEN} characters or more")
    trusted_proxies: str = Field(
        default="",
        description="addresses or networks of reverse proxies, with commas; their X-Forwarded-... is believed",
    )
    log_format: LogFormat = Field(default="text", description="text, or json: one object a line")
    executor: str = Field(
        default="embedded", description="where jobs run: embedded, in processes of the server, or dask://HOST:PORT"
    )
    job_slots: int = Field(default=1, ge=1, le=64, description="reconstructions at once, each in a process of its own")
    job_timeout: int = Field(default=3600, ge=1, description="most seconds of one reconstruction")
    job_memory: int = Field(default=2**32, ge=2**29, description="most bytes of an embedded job's process")
    preview_memory: int = Field(default=2**28, ge=0, description="most bytes of networks kept ready for previews")
    max_devices: int = Field(default=1000, ge=1, description="devices connected at once")
    max_device_rate: int = Field(
        default=1000, ge=1, description="messages a second that are read from one device, every 4 kB counting as one"
    )
    max_session_bytes: int = Field(default=2**31, ge=1, description="most bytes of messages in one session")
    max_upload_bytes: int = Field(default=2**28, ge=1, description="most bytes of an uploaded file")
    max_requests: int = Field(default=100, ge=1, description="most requests a second of one client that needs a token")

    @field_validator("token")
    @classmethod
    def _long_enough(cls, token: SecretStr | None) -> SecretStr | None:
        if token is not None and len(token.get_secret_value()) < MIN_TOKEN:
            raise ValueError(f"wanted a token of {MIN_TOKEN} characters or more, got {len(token.get_secret_value())}")
        return token

    @field_validator("database_url")
    @classmethod
    def _known_database(cls, url: str) -> str:
        if url and not url.startswith(("postgresql://", "postgres://", "postgresql+pg8000://", "sqlite:///")):
            raise ValueError(f"wanted postgresql://USER:PASSWORD@HOST/NAME or nothing, got {url.partition(':')[0]}:...")
        return url

    @field_validator("artifact_bucket")
    @classmethod
    def _known_bucket(cls, url: str) -> str:
        if url and not re.fullmatch(r"s3://[^/]+(/.*)?", url):
            raise ValueError(f"wanted s3://BUCKET, s3://BUCKET/PREFIX or nothing, got {url}")
        return url

    @field_validator("executor")
    @classmethod
    def _known_executor(cls, executor: str) -> str:
        if executor != "embedded" and not re.fullmatch(r"dask://(\[[0-9a-fA-F:]+\]|[^/:\[\]]+):\d{1,5}", executor):
            raise ValueError(f"wanted embedded or dask://HOST:PORT, got {executor!r}")
        return executor

    @model_validator(mode="after")
    def _within_reach_of_workers(self) -> Self:
        """SQLite's locks hold on one machine only: workers on others would spoil the file."""
        if self.cluster_address is None or not self.resolved_database_url.startswith("sqlite"):
            return self
        if urlsplit(self.cluster_address).hostname not in LOOPBACK:
            raise ValueError(
                f"workers of {self.executor} cannot share an SQLite database: set TRACEMESH_DATABASE_URL to "
                "postgresql://USER:PASSWORD@HOST/NAME, or use a scheduler on 127.0.0.1"
            )
        return self

    @property
    def closed(self) -> bool:
        """Whether a token is demanded."""
        return self.listen_host not in LOOPBACK or self.token is not None

    @property
    def listen_host(self) -> str:
        """Address to listen on: with `lan` all of them, unless another one is named."""
        return "0.0.0.0" if self.lan and self.host in LOOPBACK else self.host

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """The command line before the environment before the file."""
        return init_settings, env_settings, InitSettingsSource(settings_cls, _settings_file())

    @property
    def resolved_database_url(self) -> str:
        """SQLAlchemy's URL of the database, driver included."""
        if not self.database_url:
            return f"sqlite:///{self.data_dir / 'tracemesh.db'}"
        scheme, separator, rest = self.database_url.partition("://")
        return f"postgresql+pg8000{separator}{rest}" if scheme in ("postgres", "postgresql") else self.database_url

    @property
    def cluster_address(self) -> str | None:
        """The dask scheduler as dask writes it; None for embedded jobs."""
        return None if self.executor == "embedded" else self.executor.replace("dask://", "tcp://", 1)

    @property
    def artifact_dir(self) -> Path:
        """Folder of the content-addressed artifacts or, with a bucket, of what was used of them lately."""
        return self.data_dir / "artifacts"


def _settings_file() -> dict[str, Any]:
    name = os.environ.get(FILE_VARIABLE)
    if not name:
        return {}
    try:
        return tomllib.loads(Path(name).read_text())
    except OSError as error:
        raise InputError(f"{name}, named by {FILE_VARIABLE}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{name}, named by {FILE_VARIABLE}: wanted TOML: {error}") from None
