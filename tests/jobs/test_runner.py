"""Jobs on embedded slots, with the real work, the real processes and kill -9."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import update

from tracemesh.formats.meshes import read_mesh
from tracemesh.formats.networks import read_network
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import recording_from_scan
from tracemesh.jobs.runner import JobRunner
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import artifact_row, open_artifacts
from tracemesh.storage.database import Database
from tracemesh.storage.ingest import Group, commit, open_recording
from tracemesh.storage.models import ReconstructionRow
from tracemesh.storage.reconstructions import create_reconstruction, get_reconstruction, request_cancel
from tracemesh.storage.sessions import create_session, delete_session
from tracemesh.wire.resources import Reconstruction, ReconstructionParameters, SessionCreate

Start = Callable[..., JobRunner]
on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
"""For what does not depend on the kind of database; the rows themselves are tested on both in tests/storage."""


@pytest.fixture
def settings(database_url: str, tmp_path: Path) -> Settings:
    """Settings for a database of each kind."""
    return Settings(database_url=database_url, data_dir=tmp_path)


@pytest.fixture
def database(settings: Settings, shared_data: Path) -> Iterator[Database]:
    """A database with one scanned session, `s`, and an empty one, `empty`."""
    database = Database(settings.resolved_database_url)
    database.migrate()
    sent = recording_from_scan(read_rawnet((shared_data / "lilium.rawnet").read_text()), "r", "s")
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        create_session(transaction, SessionCreate(id="empty"))
        state, group = open_recording(transaction, sent.hello, sent.hello.model_dump_json().encode()), Group()
        for message in sent.messages:
            state.advance(message, 1)
            group.add(state, message, message.model_dump_json(exclude_none=True).encode())
        commit(transaction, group)
    yield database
    database.close()


@pytest.fixture
def seen() -> list[Reconstruction]:
    """What the runner told its listener."""
    return []


@pytest.fixture
def start(settings: Settings, database: Database, seen: list[Reconstruction]) -> Iterator[Start]:
    """Start runners; all are closed after the test."""
    runners: list[JobRunner] = []

    def begin(listener: Callable[[Reconstruction], None] = seen.append) -> JobRunner:
        runners.append(JobRunner(settings, database, listener))
        return runners[-1]

    yield begin
    for runner in runners:
        runner.close()


def queue(database: Database, session: str = "s") -> str:
    with database.write() as transaction:
        return create_reconstruction(transaction, session, ReconstructionParameters(step="3%")).id


def look(database: Database, job: str) -> Reconstruction:
    with database.read() as transaction:
        return get_reconstruction(transaction, job)


def wait(database: Database, job: str) -> Reconstruction:
    while (state := look(database, job)).state in ("queued", "running"):
        time.sleep(0.05)
    return state


def workers() -> list[int]:
    """Worker processes of this process; multiprocessing's own resource tracker is none."""
    me, found = str(os.getpid()), []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = (folder / "stat").read_text().rsplit(")", 1)[1].split()[1]
            command = (folder / "cmdline").read_text()
        except OSError:
            continue
        if parent == me and "spawn_main" in command:
            found.append(int(folder.name))
    return found


def test_a_job_leaves_its_files_and_tells_how_far_it_is(
    start: Start, settings: Settings, database: Database, seen: list[Reconstruction]
) -> None:
    job = queue(database)
    start().submit(job)
    done = wait(database, job)
    assert (done.state, done.error, done.fraction) == ("done", None, 1.0)
    store = open_artifacts(settings)
    with database.read() as transaction:
        files = {n: store.path(artifact_row(transaction, job, n).sha256).read_bytes() for n in done.artifacts}
    vertices, faces = read_mesh(files["mesh.glb"], "glb")
    assert len(faces) > len(vertices) > len(read_network(files["network.json"].decode()).points) > 100
    deadline = time.monotonic() + 10
    while seen[-1].state != "done" and time.monotonic() < deadline:
        time.sleep(0.02)
    fractions = [s.fraction for s in seen]
    assert fractions == sorted(fractions)
    assert {s.state for s in seen} >= {"running", "done"}


@on_sqlite
def test_a_job_runs_in_the_worker_that_was_prepared_for_it(start: Start, database: Database) -> None:
    runner = start()
    assert workers() == []
    runner.prepare()
    prepared = workers()
    assert len(prepared) == 1
    job = queue(database)
    runner.submit(job)
    assert wait(database, job).state == "done"
    assert workers() == prepared


@on_sqlite
def test_an_interrupt_at_the_terminal_leaves_workers_to_the_server(start: Start, database: Database) -> None:
    runner = start()
    for _ in range(2):
        job = queue(database)
        runner.submit(job)
        assert wait(database, job).state == "done"
        before = workers()
        os.kill(before[0], signal.SIGINT)
        time.sleep(0.2)
        assert workers() == before


@on_sqlite
def test_a_closed_runner_starts_no_worker(start: Start) -> None:
    runner = start()
    runner.close()
    runner.prepare()
    assert workers() == []


@on_sqlite
def test_what_cannot_be_reconstructed_says_why(start: Start, database: Database) -> None:
    job = queue(database, "empty")
    start().submit(job)
    failed = wait(database, job)
    assert (failed.state, failed.error) == ("failed", "session empty has no curve with samples")


@on_sqlite
def test_a_killed_worker_costs_an_attempt_not_the_job(start: Start, database: Database) -> None:
    first = queue(database)
    runner = start()
    runner.submit(first)
    wait(database, first)
    killed = threading.Thread(target=_kill_next, args=(database, second := queue(database), 1))
    killed.start()
    runner.submit(second)
    killed.join()
    done = wait(database, second)
    assert done.state == "done"
    assert _attempt(database, second) == 2


@on_sqlite
def test_a_job_that_kills_every_worker_fails_in_words(start: Start, database: Database) -> None:
    job, runner = queue(database), start()
    killed = threading.Thread(target=_kill_next, args=(database, job, 3))
    killed.start()
    runner.submit(job)
    killed.join()
    assert wait(database, job).error == "its process was lost 3 times"


@on_sqlite
def test_a_running_job_is_cancelled_between_stages(start: Start, database: Database) -> None:
    job = queue(database)
    start().submit(job)
    while look(database, job).state == "queued":
        time.sleep(0.01)
    with database.write() as transaction:
        request_cancel(transaction, job)
    cancelled = wait(database, job)
    assert (cancelled.state, cancelled.artifacts) == ("cancelled", {})


@on_sqlite
def test_what_a_lost_server_left_is_taken_up(start: Start, database: Database) -> None:
    """One row says running, though nobody runs it; one waits."""
    lost, waiting = queue(database), queue(database)
    with database.write() as transaction:
        transaction.execute(
            update(ReconstructionRow).where(ReconstructionRow.id == lost).values(state="running", attempt=1)
        )
    start()
    assert wait(database, lost).state == "done"
    assert wait(database, waiting).state == "done"
    assert (_attempt(database, lost), _attempt(database, waiting)) == (2, 1)


@on_sqlite
def test_closing_ends_the_worker_and_the_next_start_goes_on(start: Start, database: Database) -> None:
    job, runner = queue(database), start()
    runner.submit(job)
    while look(database, job).state == "queued":
        time.sleep(0.01)
    runner.close()
    assert workers() == []
    assert look(database, job).state == "running"
    start()
    assert wait(database, job).state == "done"


@on_sqlite
def test_a_session_deleted_under_its_job_harms_nobody(start: Start, database: Database) -> None:
    job, runner = queue(database), start()
    runner.submit(job)
    while look(database, job).state == "queued":
        time.sleep(0.01)
    with database.write() as transaction:
        delete_session(transaction, "s")
    after = queue(database, "empty")
    runner.submit(after)
    assert wait(database, after).state == "failed"


def _attempt(database: Database, job: str) -> int:
    with database.read() as transaction:
        return transaction.get_one(ReconstructionRow, job).attempt


def _kill_next(database: Database, job: str, times: int) -> None:
    """kill -9 the worker of each of the next attempts as soon as it runs."""
    for attempt in range(1, times + 1):
        while _attempt(database, job) < attempt or not (alive := workers()):
            time.sleep(0.01)
        for pid in alive:
            os.kill(pid, signal.SIGKILL)
        while set(workers()) & set(alive):
            time.sleep(0.01)
