"""What tests of every area share."""

import gc
import os
import resource
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
import pytest
from sqlalchemy import create_engine
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

ROOT = Path(__file__).resolve().parent.parent


class Together(LoadScopeScheduling):
    """Tests one by one to whoever is free, but for those that share something dear: they stay together, and go first.

    Browsers that draw in software starve each other, and one dask cluster is enough.
    """

    def _split_scope(self, nodeid: str) -> str:
        if nodeid.startswith("tests/web/"):
            return "browser"
        return "dask" if nodeid.startswith("tests/jobs/") and "dask" in nodeid else nodeid


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Together:
    """How pytest-xdist gives tests out."""
    return Together(config, log)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of scans and networks with known truth, kept beside the checkout."""
    folder = ROOT.parent / "shared" / "data"
    assert folder.is_dir(), f"wanted the data with known truth in {folder}"
    return folder


@dataclass(frozen=True)
class PostgreSql:
    """A real PostgreSQL: its URL, less a database's name, and what restarts it as after a crash, with options."""

    url: str
    restart: Callable[..., None]

    def crash(self) -> None:
        self.restart()

    @contextmanager
    def no_file_beyond(self, size: int) -> Iterator[None]:
        """No file of it grows beyond so many bytes meanwhile, as on a full disk."""
        limits = size, resource.RLIM_INFINITY
        self.restart(preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limits))
        try:
            yield
        finally:
            self.restart()


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgreSql]:
    """A real PostgreSQL that lives as long as the tests."""
    programs = [Path(found).parent for found in [shutil.which("initdb")] if found]
    programs += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    assert programs, "wanted PostgreSQL (Debian: apt-get install postgresql), found no initdb"
    folder = Path(tempfile.mkdtemp(prefix="tracemesh-postgresql-"))
    user = "nobody" if os.geteuid() == 0 else None  # PostgreSQL refuses to run as root
    if user:
        shutil.chown(folder, user)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]

    def run(program: str, *arguments: str, **options: Any) -> None:
        command = [programs[0] / program, "-D", folder / "data", *arguments]
        told = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        done = subprocess.run(command, user=user, cwd=folder, **told, **options)
        assert done.returncode == 0, done.stderr.decode()

    run("initdb", "-U", "tracemesh", "-A", "trust", "--no-sync", "-E", "UTF8", "--wal-segsize", "1")
    options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories= -c fsync=off"
    start = ("-w", "-o", options, "-l", str(folder / "log"))
    run("pg_ctl", *start, "start")
    url = f"postgresql+pg8000://tracemesh@127.0.0.1:{port}"
    yield PostgreSql(url, partial(run, "pg_ctl", *start, "-m", "immediate", "restart"))
    run("pg_ctl", "-w", "-m", "immediate", "stop")
    shutil.rmtree(folder)


@contextmanager
def sockets_may_be_left() -> Iterator[None]:
    """pg8000 and dask leave those of torn connections to the garbage collector, which warns."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "unclosed <socket", ResourceWarning)
        yield
        gc.collect()


@pytest.fixture
def torn_connections() -> Iterator[None]:
    """For who tears connections."""
    with sockets_may_be_left():
        yield


@pytest.fixture(scope="session")
def new_database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """Make an empty database, "sqlite" or "postgresql"; its URL."""

    def make(kind: str) -> str:
        if kind == "sqlite":
            return f"sqlite:///{tmp_path_factory.mktemp('sqlite') / 'test.db'}"
        server, name = request.getfixturevalue("postgresql").url, f"test_{uuid4().hex}"
        engine = create_engine(f"{server}/postgres", isolation_level="AUTOCOMMIT")
        with engine.connect() as connection:
            connection.exec_driver_sql(f"CREATE DATABASE {name}")
        engine.dispose()
        return f"{server}/{name}"

    return make


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, new_database: Callable[[str], str]) -> str:
    """URL of an empty database, once of each kind."""
    return new_database(request.param)


@dataclass(frozen=True)
class S3Server:
    """A real S3-compatible server with one bucket: its URL, and what takes it away and brings it back, empty."""

    bucket: str
    stop: Callable[[], None]
    start: Callable[[], None]


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch) -> Iterator[S3Server]:
    """Programs that are started meanwhile find it by the usual variables, too."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    endpoint, running = f"http://127.0.0.1:{port}", []
    for name, value in (
        ("ENDPOINT_URL", endpoint),
        ("ACCESS_KEY_ID", "k"),
        ("SECRET_ACCESS_KEY", "s"),
        ("REGION", "x"),
    ):
        monkeypatch.setenv(f"AWS_{name}", value)

    def start() -> None:
        command = [Path(sys.executable).parent / "moto_server", "-H", "127.0.0.1", "-p", str(port)]
        running.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        while True:
            with suppress(httpx.TransportError):
                httpx.put(f"{endpoint}/bucket").raise_for_status()
                return
            assert running[-1].poll() is None, "the S3 server did not start"
            time.sleep(0.05)

    def stop() -> None:
        running[-1].kill()
        running[-1].wait()

    start()
    yield S3Server("s3://bucket/some/prefix", stop, start)
    stop()
