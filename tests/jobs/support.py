"""What the tests of jobs do with rows and processes."""

import os
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tracemesh.storage.database import Database
from tracemesh.storage.models import ReconstructionRow
from tracemesh.storage.reconstructions import create_reconstruction, get_reconstruction
from tracemesh.wire.resources import Reconstruction, ReconstructionParameters

PATIENCE = 120.0
"""s until a test gives up waiting."""
LONG = "1%"
"""Step of a job that takes seconds."""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def queue(database: Database, session: str = "s", step: str = "3%") -> str:
    with database.write() as transaction:
        return create_reconstruction(transaction, session, ReconstructionParameters(step=step)).id


def look(database: Database, job: str) -> Reconstruction:
    with database.read() as transaction:
        return get_reconstruction(transaction, job)


def row(database: Database, job: str) -> ReconstructionRow:
    with database.read() as transaction:
        return transaction.get_one(ReconstructionRow, job)


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "waited for too long"
        time.sleep(0.01)


def wait(database: Database, job: str) -> Reconstruction:
    until(lambda: look(database, job).state not in ("queued", "running"))
    return look(database, job)


def wait_until_it_works(database: Database, job: str) -> None:
    until(lambda: look(database, job).fraction > 0 or look(database, job).state not in ("queued", "running"))


def _children(parent: int) -> list[int]:
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            above = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            continue
        if above == parent:
            found.append(int(folder.name))
    return found


def workers(parent: int | None = None) -> list[int]:
    """Worker processes that a process started, or had copied; multiprocessing's own helpers are none."""
    copied = [pid for origin in origins(parent) for pid in _children(origin)]
    return copied + [pid for pid in _children(parent or os.getpid()) if "spawn_main" in _command(pid)]


def origins(parent: int | None = None) -> list[int]:
    """The process that a process has its workers copied from, if there is one yet."""
    return [pid for pid in _children(parent or os.getpid()) if "forkserver" in _command(pid)]


def kill(pids: list[int]) -> None:
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    wait_for_end(pids)


@contextmanager
def paused(pids: list[int]) -> Iterator[None]:
    """Processes that neither work nor answer meanwhile."""
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def wait_for_end(pids: list[int]) -> None:
    until(lambda: not any(_command(pid) for pid in pids))


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""
