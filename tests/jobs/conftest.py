"""A scanned session in a database of each kind, runners, and a real dask cluster."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from distributed import Client

from tests.jobs.support import free_port, kill, workers
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import recording_from_scan
from tracemesh.jobs.runner import JobRunner
from tracemesh.settings import Settings
from tracemesh.storage.database import Database
from tracemesh.storage.ingest import record
from tracemesh.storage.sessions import create_session
from tracemesh.wire.resources import Reconstruction, SessionCreate


@dataclass
class DaskCluster:
    """A scheduler and two workers, each a process of its own with a nanny that replaces a lost one."""

    folder: Path
    port: int = field(default_factory=free_port)
    scheduler: subprocess.Popen[bytes] | None = None
    workers: subprocess.Popen[bytes] | None = None

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def start(self) -> None:
        self.scheduler = self._run("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")
        options = ["--nworkers", "2", "--nthreads", "1", "--host", "127.0.0.1", "--no-dashboard"]
        self.workers = self._run("worker", f"tcp://{self.address}", "--local-directory", str(self.folder), *options)
        self.wait_for_workers()

    def wait_for_workers(self) -> None:
        with Client(f"tcp://{self.address}", timeout=60, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)

    def pids(self) -> list[int]:
        """Processes that run functions."""
        assert self.workers is not None
        return workers(self.workers.pid)

    def stop(self) -> None:
        assert self.workers is not None
        left = self.pids()
        for process in (self.workers, self.scheduler):
            if process is not None:
                process.kill()
                process.wait()
        kill([pid for pid in left if Path(f"/proc/{pid}").exists()])

    def _run(self, *command: str) -> subprocess.Popen[bytes]:
        log = (self.folder / f"{command[0]}.log").open("ab")
        try:
            arguments = [sys.executable, "-m", "dask", *command]
            return subprocess.Popen(arguments, stdout=log, stderr=log, cwd=self.folder)
        finally:
            log.close()


@pytest.fixture(scope="session")
def dask_cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    """A cluster for all tests that leave it as it was."""
    cluster = DaskCluster(tmp_path_factory.mktemp("dask"))
    cluster.start()
    yield cluster
    cluster.stop()


@pytest.fixture(params=["embedded", "dask"])
def executor(request: pytest.FixtureRequest) -> str:
    """The setting for each kind of executor."""
    if request.param == "embedded":
        return "embedded"
    return f"dask://{request.getfixturevalue('dask_cluster').address}"


@pytest.fixture
def settings(database_url: str, executor: str, tmp_path: Path) -> Settings:
    """Settings for a database and an executor of each kind."""
    return Settings(database_url=database_url, data_dir=tmp_path, executor=executor)


@pytest.fixture
def database(settings: Settings, shared_data: Path) -> Iterator[Database]:
    """A database with one scanned session, `s`, and an empty one, `empty`."""
    database = Database(settings.resolved_database_url)
    database.migrate()
    sent = recording_from_scan(read_rawnet((shared_data / "lilium.rawnet").read_text()), "r", "s")
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        create_session(transaction, SessionCreate(id="empty"))
        lines = [(message, message.model_dump_json(exclude_none=True).encode()) for message in sent.messages]
        record(transaction, sent.hello, sent.hello.model_dump_json().encode(), lines)
    yield database
    database.close()


@pytest.fixture
def seen() -> list[Reconstruction]:
    """What the runners told their listener."""
    return []


@pytest.fixture
def start(settings: Settings, database: Database, seen: list[Reconstruction]) -> Iterator[Callable[..., JobRunner]]:
    """Start runners, with settings of one's own; all are closed after the test."""
    runners: list[JobRunner] = []

    def begin(**options: Any) -> JobRunner:
        runners.append(JobRunner(settings.model_copy(update=options), database, seen.append))
        return runners[-1]

    yield begin
    for runner in runners:
        runner.close()


@pytest.fixture
def quick_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is lost is found soon."""
    monkeypatch.setattr("tracemesh.jobs.runner.LEASE", 1.5)
    monkeypatch.setattr("tracemesh.jobs.runner.BEAT", 0.2)
