"""Jobs with the real work on real processes, of the server's own and of a dask cluster; kill -9 included."""

import os
import signal
import time
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import update

from tests.jobs.support import LONG, kill, look, queue, row, until, wait, wait_until_it_works, workers
from tracemesh.formats.meshes import read_mesh
from tracemesh.formats.networks import read_network
from tracemesh.jobs.runner import JobRunner
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import artifact_row, open_artifacts
from tracemesh.storage.database import Database
from tracemesh.storage.models import BATCH, ReconstructionRow
from tracemesh.storage.reconstructions import Claim, claim_next, request_cancel
from tracemesh.storage.sessions import delete_session
from tracemesh.wire.resources import Reconstruction

Start = Callable[..., JobRunner]
embedded = pytest.mark.parametrize("executor", ["embedded"], indirect=True)


def test_a_job_leaves_its_files_and_tells_how_far_it_is(
    start: Start, settings: Settings, database: Database, seen: list[Reconstruction]
) -> None:
    job = queue(database)
    start()
    done = wait(database, job)
    assert (done.state, done.error, done.fraction) == ("done", None, 1.0)
    store = open_artifacts(settings)
    with database.read() as transaction:
        files = {n: store.path(artifact_row(transaction, job, n).sha256).read_bytes() for n in done.artifacts}
    vertices, faces = read_mesh(files["mesh.glb"], "glb")
    assert len(faces) > len(vertices) > len(read_network(files["network.json"].decode()).points) > 100
    until(lambda: seen[-1].state == "done")
    fractions = [s.fraction for s in seen]
    assert fractions == sorted(fractions)
    assert {s.state for s in seen} >= {"running", "done"}


def test_two_servers_share_the_jobs(start: Start, database: Database) -> None:
    """Each job runs once, though two servers that came one after the other look for work."""
    start(job_slots=2)
    jobs = [queue(database) for _ in range(4)]
    start(job_slots=2)
    assert {wait(database, job).state for job in jobs} == {"done"}
    assert {row(database, job).attempt for job in jobs} == {1}


@embedded
def test_a_job_runs_in_the_worker_that_was_prepared_for_it(start: Start, database: Database) -> None:
    runner = start()
    assert workers() == []
    runner.prepare()
    prepared = workers()
    assert len(prepared) == 1
    assert wait(database, queue(database)).state == "done"
    assert workers() == prepared


@embedded
def test_an_interrupt_at_the_terminal_leaves_workers_to_the_server(start: Start, database: Database) -> None:
    start()
    for _ in range(2):
        assert wait(database, queue(database)).state == "done"
        before = workers()
        os.kill(before[0], signal.SIGINT)
        time.sleep(0.2)
        assert workers() == before


@embedded
def test_a_closed_runner_starts_no_worker(start: Start) -> None:
    runner = start()
    runner.close()
    runner.prepare()
    assert workers() == []


def test_what_cannot_be_reconstructed_says_why(start: Start, database: Database) -> None:
    job = queue(database, "empty")
    start()
    failed = wait(database, job)
    assert (failed.state, failed.error) == ("failed", "session empty has no curve with samples")


@embedded
def test_a_killed_worker_costs_an_attempt_not_the_job(start: Start, database: Database) -> None:
    start()
    wait(database, queue(database))
    job = queue(database, step=LONG)
    wait_until_it_works(database, job)
    kill(workers())
    assert wait(database, job).state == "done"
    assert (row(database, job).attempt, row(database, job).losses) == (2, 1)


@embedded
def test_a_job_that_kills_every_worker_fails_in_words(start: Start, database: Database) -> None:
    job = queue(database, step=LONG)
    start()
    for attempt in (1, 2):
        until(lambda attempt=attempt: row(database, job).attempt == attempt and look(database, job).fraction > 0)
        kill(workers())
    assert wait(database, job).error == "its process was lost 2 times"


def test_a_running_job_is_cancelled_between_stages(start: Start, database: Database) -> None:
    job = queue(database, step=LONG)
    start()
    wait_until_it_works(database, job)
    with database.write() as transaction:
        request_cancel(transaction, job)
    cancelled = wait(database, job)
    assert (cancelled.state, cancelled.artifacts) == ("cancelled", {})


def test_a_job_that_takes_too_long_fails_in_words_and_frees_its_worker(start: Start, database: Database) -> None:
    job, after = queue(database, step=LONG), queue(database)
    runner = start(job_timeout=1)
    failed = wait(database, job)
    assert (failed.state, failed.error) == ("failed", "it took longer than 1 s")
    runner.close()
    start()
    assert wait(database, after).state in ("done", "failed")


@embedded
def test_a_job_that_needs_too_much_memory_fails_in_words(start: Start, database: Database) -> None:
    job = queue(database, step="0.002%")
    start(job_memory=2**29)
    assert wait(database, job).error == "it needs more memory than there is"


@embedded
def test_who_waits_for_a_job_does_not_wait_for_batches(start: Start, database: Database) -> None:
    batch = [queue(database) for _ in range(3)]
    with database.write() as transaction:
        transaction.execute(update(ReconstructionRow).values(priority=BATCH))
    interactive = queue(database)
    start()
    wait(database, interactive)
    assert [look(database, job).state for job in batch[1:]] == ["queued", "queued"]
    assert {wait(database, job).state for job in batch} == {"done"}


@pytest.mark.usefixtures("quick_lease")
def test_what_a_lost_server_left_is_taken_up(start: Start, database: Database) -> None:
    """One row says running, though nobody watches over it; one waits."""
    lost, waiting = queue(database), queue(database)
    with database.write() as transaction:
        assert claim_next(transaction) == Claim(lost, 1)
    start()
    assert wait(database, lost).state == "done"
    assert wait(database, waiting).state == "done"
    assert (row(database, lost).attempt, row(database, waiting).attempt) == (2, 1)


@embedded
@pytest.mark.usefixtures("quick_lease")
def test_a_server_that_comes_later_leaves_what_another_one_runs(start: Start, database: Database) -> None:
    job = queue(database, step=LONG)
    start()
    wait_until_it_works(database, job)
    start()
    assert wait(database, job).state == "done"
    assert row(database, job).attempt == 1


def test_closing_gives_jobs_up_and_the_next_start_goes_on(start: Start, database: Database) -> None:
    job, runner = queue(database, step=LONG), start()
    wait_until_it_works(database, job)
    runner.close()
    assert workers() == []
    assert (look(database, job).state, row(database, job).losses) == ("queued", 0)
    start()
    assert wait(database, job).state == "done"


def test_a_session_deleted_under_its_job_harms_nobody(start: Start, database: Database) -> None:
    job = queue(database, step=LONG)
    start()
    wait_until_it_works(database, job)
    with database.write() as transaction:
        delete_session(transaction, "s")
    assert wait(database, queue(database, "empty")).state == "failed"


def test_an_artifact_store_that_is_away_is_told(start: Start, settings: Settings, database: Database) -> None:
    """Where its folder should be is a file; once that is gone, the same wish is granted."""
    start()
    settings.artifact_dir.rmdir()
    settings.artifact_dir.write_text("in the way")
    failed = wait(database, queue(database))
    assert failed.state == "failed"
    assert failed.error == "its files could not be stored: Not a directory; try again"
    settings.artifact_dir.unlink()
    assert wait(database, queue(database)).state == "done"


@embedded
@pytest.mark.usefixtures("torn_connections", "quick_lease")
@pytest.mark.parametrize("database_url", ["postgresql"], indirect=True)
def test_a_database_that_crashes_under_a_job_costs_at_most_an_attempt(
    start: Start, database: Database, postgresql: Any
) -> None:
    job = queue(database, step=LONG)
    start()
    wait_until_it_works(database, job)
    postgresql.crash()
    assert wait(database, job).state == "done"
    assert wait(database, queue(database)).state == "done"
