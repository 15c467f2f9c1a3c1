"""The service from outside: how many requests a second, what others notice of reconstructions, what a session costs."""

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TypeVar

import httpx
import numpy as np

from benchmarks.data import Data, built_in
from benchmarks.serving import Serving, dask_cluster, descendants, memory, processor_time, serving, serving_from
from benchmarks.table import Cell, Column, Table
from benchmarks.workers import worker_starts
from tracemesh.formats.recordings import recording_from_simulation, write_recording
from tracemesh.geometry.simulated.simulation import plan_scan, simulate_scan

SLOTS = 2
CLIENTS = 4
SLIDER = 0.1
"""s between two previews of somebody who moves a slider."""
SHAPE, STEP = "leaf", "1.6%"
T = TypeVar("T")


def requests(data: Data, count: int = 400, sessions: int = 100) -> Table:
    """Table of one row per kind of request. `data` is not needed."""
    columns = Column("request"), Column("requests/s", ".0f"), *(Column(f"{q}, ms", ".1f") for q in ("p50", "p99"))
    with serving() as server, _client(server) as http:
        for _ in range(sessions - 1):
            http.post("/sessions", json={"name": "one of many"}).raise_for_status()
        session = _recorded(http)
        mesh = _reconstructed(http, session)["artifacts"]["mesh.glb"]
        size = len(http.get(f"http://127.0.0.1:{server.port}{mesh}").content) / 1e6
        kinds: dict[str, Callable[[httpx.Client, int], httpx.Response]] = {
            f"list of {sessions} sessions": lambda http, _: http.get(f"/sessions?limit={sessions}"),
            f"GLB of {size:.2f} MB": lambda http, _: http.get(f"http://127.0.0.1:{server.port}{mesh}"),
            "preview": lambda http, number: _preview(http, session, number),
        }
        rows = tuple((name, *_rated(server, ask, count)) for name, ask in kinds.items())
    notes = (
        f"""One server process on SQLite; {CLIENTS} clients that ask again as soon as they have their answer share the
        machine with it. Previews are of the built-in {SHAPE}, scanned by the simulated Morphorider, each with another
        smoothing.""",
    )
    return Table("requests", "Requests", columns, rows, notes)


def jobs(data: Data, count: int = 32, step: str = STEP) -> Table:
    """Table of one row per executor: reconstructions at once, and a slider meanwhile. `data` is not needed."""
    columns = (
        Column("executor"),
        Column("reconstructions/s", ".2f"),
        Column("processor time of one, s", ".2f"),
        Column("memory of its process, MB", ".0f"),
        *(Column(f"preview {q} meanwhile, ms", ".0f") for q in ("p50", "p95")),
    )
    with serving(job_slots=SLOTS) as server:
        embedded = _burst(server, server.process.pid, count, step)
    with dask_cluster(SLOTS) as (executor, workers), serving(job_slots=SLOTS, executor=executor) as server:
        clustered = _burst(server, workers, count, step)
    rows = (("embedded", *embedded), ("dask", *clustered))
    notes = (
        f"""{count} reconstructions, network and surface, of the built-in {SHAPE} queued at once for {SLOTS} processes,
        while somebody moves a slider: a preview every {SLIDER:g} s. Everything is on one machine.""",
    )
    return Table("jobs", "Reconstructions at once", columns, rows, notes)


def starts(data: Data, count: int = 7) -> Table:
    """Table of how soon a server answers, and what it then needs. `data` is not needed."""
    columns = (
        Column("what"),
        *(Column(what, spec) for what, spec in (("answers after, s", ".2f"), ("processor time, s", ".2f"))),
        Column("memory once idle, MB", ".0f"),
    )
    new, known = list[tuple[float, ...]](), list[tuple[float, ...]]()
    for _ in range(count):
        with tempfile.TemporaryDirectory() as folder:
            for measured in (new, known):
                with serving_from(Path(folder)) as server:
                    spent = processor_time(server.process.pid)
                    measured.append((server.start_seconds, spent, _idle(server)))
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (what, *map(float, np.median(measured, axis=0)))
        for what, measured in (("a server in a new folder", new), ("a server in a folder that it knows", known))
    )
    first, further, own = map(float, np.median([worker_starts() for _ in range(count)], axis=0))
    rows += (("its first worker process", first, None, None), ("a further one", further, None, own))
    notes = (
        f"""From the start of the process to its first answer, medians of {count}, on SQLite, Python's bytecode being
        there as in an installed package. Budgets: 2 s, 150 MB. A worker answers when the kernel is loaded; memory of a
        further one is what it shares with none.""",
    )
    return Table("starts", "The start of a server", columns, rows, notes)


def costs(data: Data, sessions: int = 20, step: str = STEP) -> Table:
    """Table of what one session costs. `data` is not needed."""
    columns = (
        Column("what"),
        Column("kB on disk", ".0f"),
        Column("processor time, s", ".3f"),
        Column("memory, MB", ".0f"),
    )
    with serving() as server, _client(server) as http:
        pid = server.process.pid
        rows: list[tuple[Cell, ...]] = []
        texts = [_recording(seed) for seed in range(sessions)]  # alike results would be kept once
        made, spent, size = _spent(server, processor_time, lambda: [_recorded(http, text) for text in texts])
        rows.append(
            (
                f"a session, {sum(map(len, texts)) / sessions / 1000:.0f} kB as sent",
                size / sessions,
                spent / sessions,
                None,
            )
        )
        _reconstructed(http, made[0], step)  # the process has started, the kernel is loaded
        _, spent, size = _spent(server, _busy, lambda: [_reconstructed(http, session, step) for session in made])
        rows.append(("its reconstruction", size / sessions, spent / sessions, _peak(pid)))
        _preview(http, made[0], 0)
        _, spent, _ = _spent(server, _busy, lambda: [_preview(http, made[0], k) for k in range(sessions)])
        rows.append(("a preview of it", None, spent / sessions, None))
    notes = (
        f"""The built-in {SHAPE}, scanned by the simulated Morphorider and sent as a file; means of {sessions}. Memory:
        the peak of a worker's process.""",
    )
    return Table("costs", "What a session costs", columns, tuple(rows), notes)


def _spent(server: Serving, busy: Callable[[int], float], work: Callable[[], T]) -> tuple[T, float, float]:
    """What some work gives, its processor time in s, and what it leaves on disk in kB."""
    before, size = busy(server.process.pid), _size(server.folder)
    result = work()
    return result, busy(server.process.pid) - before, (_size(server.folder) - size) / 1000


@contextmanager
def _client(server: Serving) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=server.url, timeout=120) as http:
        yield http


def _rated(server: Serving, ask: Callable[[httpx.Client, int], httpx.Response], count: int) -> tuple[Cell, ...]:
    """Requests a second, and the median and the 99th percentile of their times in ms."""

    def work(first: int) -> list[float]:
        with _client(server) as http:
            ask(http, first).raise_for_status()
            return [_timed(partial(ask, http, number)) for number in range(first, count, CLIENTS)]

    begin = time.perf_counter()
    with ThreadPoolExecutor(CLIENTS) as pool:
        times = [seconds for part in pool.map(work, range(CLIENTS)) for seconds in part]
    rate = len(times) / (time.perf_counter() - begin)
    return rate, *(float(q) for q in 1000 * np.quantile(times, (0.5, 0.99)))


def _timed(ask: Callable[[], httpx.Response]) -> float:
    begin = time.perf_counter()
    ask().raise_for_status()
    return time.perf_counter() - begin


def _burst(server: Serving, parent: int, count: int, step: str) -> tuple[Cell, ...]:
    """Reconstructions a second, what one costs, and previews meanwhile in ms; `parent` has the processes of jobs."""
    with _client(server) as http:
        session = _recorded(http)
        for _ in range(SLOTS):
            _reconstructed(http, session, step)
        _preview(http, session, 0)
        waits, done = list[float](), threading.Event()
        slider = threading.Thread(target=_slide, args=(server, session, waits, done))
        busy, begin = _busy(parent), time.perf_counter()
        queued = [_queued(http, session, step) for _ in range(count)]
        slider.start()
        for job in queued:
            _finished(http, job)
        seconds, busy = time.perf_counter() - begin, _busy(parent) - busy
        done.set()
        slider.join()
    p50, p95 = (float(q) for q in 1000 * np.quantile(waits, (0.5, 0.95)))
    return count / seconds, busy / count, _peak(parent), p50, p95


def _slide(server: Serving, session: str, waits: list[float], done: threading.Event) -> None:
    with _client(server) as http:
        while not done.wait(SLIDER):
            waits.append(_timed(lambda: _preview(http, session, len(waits))))


def _preview(http: httpx.Client, session: str, number: int) -> httpx.Response:
    wish = {"bend": 0.001 * (1 + number % 50)}
    return http.post(f"/sessions/{session}/preview", params={"client": threading.get_ident()}, json=wish)


def _recording(seed: int = 1) -> bytes:
    simulated = simulate_scan(plan_scan(built_in(SHAPE), seed=seed), seed)
    return write_recording(recording_from_simulation(simulated, SHAPE)).encode()


def _recorded(http: httpx.Client, text: bytes | None = None) -> str:
    session = str(http.post("/sessions", json={}).json()["id"])
    http.post(f"/sessions/{session}/recordings", content=text or _recording()).raise_for_status()
    return session


def _reconstructed(http: httpx.Client, session: str, step: str = STEP) -> dict[str, dict[str, str]]:
    return _finished(http, _queued(http, session, step))


def _queued(http: httpx.Client, session: str, step: str) -> str:
    return str(http.post(f"/sessions/{session}/reconstructions", json={"step": step}).json()["id"])


def _finished(http: httpx.Client, job: str) -> dict[str, dict[str, str]]:
    while (state := http.get(f"/reconstructions/{job}").json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    if state["state"] != "done":
        raise RuntimeError(state["error"])
    found: dict[str, dict[str, str]] = state
    return found


def _busy(parent: int) -> float:
    """Processor time of all processes below one, s: those of jobs and of previews."""
    return sum(processor_time(pid) for pid in descendants(parent))


def _peak(parent: int) -> float:
    return max(memory(pid, "VmHWM") for pid in descendants(parent))


def _idle(server: Serving) -> float:
    time.sleep(2)
    return memory(server.process.pid)


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
