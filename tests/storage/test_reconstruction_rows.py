"""The job table: every way that a row may go."""

import pytest

from tracemesh.errors import Conflict, NotFound
from tracemesh.storage import reconstructions as jobs
from tracemesh.storage.database import Database
from tracemesh.storage.sessions import create_session, get_session
from tracemesh.wire.resources import ReconstructionParameters, SessionCreate


@pytest.fixture
def queued(database: Database) -> str:
    """A queued reconstruction."""
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        return jobs.create_reconstruction(transaction, "s", ReconstructionParameters(step="2%")).id


def test_from_queued_to_done(database: Database, queued: str) -> None:
    with database.write() as transaction:
        assert jobs.claim(transaction, queued) == 1
        assert jobs.claim(transaction, queued) is None
        assert jobs.report_progress(transaction, queued, 1, "positions", 0.5)
        running = jobs.get_reconstruction(transaction, queued)
        assert (running.state, running.stage, running.fraction) == ("running", "positions", 0.5)
        assert running.parameters == ReconstructionParameters(step="2%")
        assert get_session(transaction, "s").latest_reconstruction is None
        assert jobs.finish(transaction, queued, 1, "done", artifacts={"report.json": ("ab" * 32, 7)})
    with database.read() as transaction:
        done = jobs.get_reconstruction(transaction, queued)
        assert (done.state, done.error) == ("done", None)
        assert done.artifacts == {"report.json": f"/api/v1/reconstructions/{queued}/report.json"}
        assert done.finished is not None
        assert done.finished >= done.created
        assert get_session(transaction, "s").latest_reconstruction == queued


def test_a_lost_attempt_cannot_write_any_more(database: Database, queued: str) -> None:
    with database.write() as transaction:
        assert jobs.claim(transaction, queued) == 1
        assert jobs.requeue(transaction, queued, 1)
        assert jobs.claim(transaction, queued) == 2
        assert not jobs.report_progress(transaction, queued, 1, "late", 0.9)
        assert not jobs.finish(transaction, queued, 1, "done", artifacts={"mesh.glb": ("cd" * 32, 1)})
        assert not jobs.requeue(transaction, queued, 1)
        assert jobs.get_reconstruction(transaction, queued).stage == ""
        assert jobs.finish(transaction, queued, 2, "done")
        assert jobs.get_reconstruction(transaction, queued).artifacts == {}


def test_it_is_not_tried_for_ever(database: Database, queued: str) -> None:
    with database.write() as transaction:
        for attempt in range(1, jobs.MAX_ATTEMPTS + 1):
            assert jobs.claim(transaction, queued) == attempt
            assert jobs.requeue(transaction, queued, attempt) == (attempt < jobs.MAX_ATTEMPTS)
        failed = jobs.get_reconstruction(transaction, queued)
        assert (failed.state, failed.error) == ("failed", f"its process was lost {jobs.MAX_ATTEMPTS} times")


def test_cancelling(database: Database, queued: str) -> None:
    with database.write() as transaction:
        other = jobs.create_reconstruction(transaction, "s", ReconstructionParameters()).id
        assert jobs.request_cancel(transaction, other).state == "cancelled"
        with pytest.raises(Conflict, match="cancelled already"):
            jobs.request_cancel(transaction, other)
        jobs.claim(transaction, queued)
        assert jobs.request_cancel(transaction, queued).state == "running"
        assert not jobs.report_progress(transaction, queued, 1, "next", 0.5)
        assert not jobs.requeue(transaction, queued, 1)
        assert jobs.get_reconstruction(transaction, queued).state == "cancelled"
        with pytest.raises(NotFound):
            jobs.request_cancel(transaction, "none")


def test_after_a_crash_what_was_unfinished_waits_again(database: Database, queued: str) -> None:
    with database.write() as transaction:
        second, third = (jobs.create_reconstruction(transaction, "s", ReconstructionParameters()).id for _ in range(2))
        jobs.claim(transaction, queued)
        jobs.claim(transaction, third)
        jobs.finish(transaction, third, 1, "failed", "why")
    with database.write() as transaction:
        assert jobs.requeue_unfinished(transaction) == [queued, second]
        assert jobs.claim(transaction, queued) == 2
