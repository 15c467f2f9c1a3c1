"""A server process to be measured, and what Linux tells of processes."""

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

TICK = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Serving:
    """A server that answers, its data folder, and how many seconds it took from its start to its first answer."""

    process: subprocess.Popen[bytes]
    port: int
    folder: Path
    start_seconds: float

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/api/v1"


@contextmanager
def serving(**settings: str | int) -> Iterator[Serving]:
    """A server of its own data, with these settings, until the end of the block."""
    with tempfile.TemporaryDirectory() as folder, serving_from(Path(folder), **settings) as server:
        yield server


@contextmanager
def serving_from(folder: Path, **settings: str | int) -> Iterator[Serving]:
    """A server of the data in a folder, new or known. Python keeps what it compiles, as in an installed package."""
    port = free_port()
    command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(port), "--data-dir", str(folder)]
    environment = {f"TRACEMESH_{name.upper()}": str(value) for name, value in settings.items()}
    begin = time.perf_counter()
    process = subprocess.Popen(
        command, stderr=subprocess.DEVNULL, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "", **environment}
    )
    try:
        wait_for_server(port)
        yield Serving(process, port, folder, time.perf_counter() - begin)
    finally:
        process.terminate()
        process.wait()


@contextmanager
def dask_cluster(workers: int) -> Iterator[tuple[str, int]]:
    """A scheduler and its workers on this machine: the executor's setting, and the process that has the workers."""
    with tempfile.TemporaryDirectory() as folder:
        port = free_port()
        options = ["--host", "127.0.0.1", "--no-dashboard"]
        scheduler = _dask("scheduler", "--port", str(port), *options)
        each = ["--nworkers", str(workers), "--nthreads", "1", "--local-directory", folder]
        worker = _dask("worker", f"tcp://127.0.0.1:{port}", *each, *options)
        try:
            yield f"dask://127.0.0.1:{port}", worker.pid
        finally:
            for process in (worker, scheduler):
                process.terminate()
                process.wait()


def _dask(*arguments: str) -> subprocess.Popen[bytes]:
    """As docs/jobs.md says of workers beside a server."""
    return subprocess.Popen(["nice", sys.executable, "-m", "dask", *arguments], stderr=subprocess.DEVNULL)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for_server(port: int) -> None:
    deadline = time.monotonic() + 60
    while True:
        try:
            urlopen(f"http://127.0.0.1:{port}/healthz").close()
            return
        except URLError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.01)


def processor_time(pid: int) -> float:
    """Seconds of processor time of a process (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def memory(pid: int, which: str = "VmRSS") -> float:
    """Resident memory of a process, now or (VmHWM) at its peak, MB (Linux)."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split(f"{which}:")[1].split()[0]) / 1000


def descendants(pid: int) -> list[int]:
    """Processes that a process started, and those that they started (Linux)."""
    found = [pid]
    for parent in found:
        for task in Path(f"/proc/{parent}/task").glob("*/children"):
            found += map(int, task.read_text().split())
    return found[1:]
