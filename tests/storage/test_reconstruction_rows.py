"""The job table: every way that a row may go."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import Conflict, NotFound
from tracemesh.storage import reconstructions as jobs
from tracemesh.storage.database import Database
from tracemesh.storage.models import BATCH, ReconstructionRow
from tracemesh.storage.sessions import create_session, get_session
from tracemesh.wire.resources import ReconstructionParameters, SessionCreate


@pytest.fixture
def queued(database: Database) -> str:
    """A queued reconstruction."""
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        return jobs.create_reconstruction(transaction, "s", ReconstructionParameters(step="2%")).id


def claimed(transaction: Transaction) -> jobs.Claim:
    claim = jobs.claim_next(transaction)
    assert claim is not None
    return claim


def test_from_queued_to_done(database: Database, queued: str) -> None:
    with database.write() as transaction:
        assert jobs.count_waiting(transaction) == 1
        claim = claimed(transaction)
        assert claim == (queued, 1)
        assert jobs.claim_next(transaction) is None
        assert jobs.count_waiting(transaction) == 0
        assert jobs.begin(transaction, claim)
        assert jobs.report_progress(transaction, claim, "positions", 0.5)
        running = jobs.get_reconstruction(transaction, queued)
        assert (running.state, running.stage, running.fraction) == ("running", "positions", 0.5)
        assert running.parameters == ReconstructionParameters(step="2%")
        assert get_session(transaction, "s").latest_reconstruction is None
        assert jobs.finish(transaction, claim, "done", artifacts={"report.json": ("ab" * 32, 7)})
    with database.read() as transaction:
        done = jobs.get_reconstruction(transaction, queued)
        assert (done.state, done.error) == ("done", None)
        assert done.artifacts == {"report.json": f"/api/v1/reconstructions/{queued}/report.json"}
        assert done.finished is not None
        assert done.finished >= done.created
        assert get_session(transaction, "s").latest_reconstruction == queued


def test_a_lost_attempt_cannot_write_any_more(database: Database, queued: str) -> None:
    with database.write() as transaction:
        first = claimed(transaction)
        assert jobs.lose(transaction, first)
        second = claimed(transaction)
        assert second == (queued, 2)
        assert not jobs.begin(transaction, first)
        assert not jobs.report_progress(transaction, first, "late", 0.9)
        assert not jobs.finish(transaction, first, "done", artifacts={"mesh.glb": ("cd" * 32, 1)})
        assert not jobs.lose(transaction, first)
        assert not jobs.release(transaction, first)
        assert jobs.get_reconstruction(transaction, queued).stage == ""
        assert jobs.finish(transaction, second, "done")
        assert jobs.get_reconstruction(transaction, queued).artifacts == {}


def test_an_attempt_begins_once(database: Database, queued: str) -> None:
    with database.write() as transaction:
        claim = claimed(transaction)
        assert [jobs.begin(transaction, claim) for _ in range(2)] == [True, False]


def test_what_is_lost_is_tried_once_more(database: Database, queued: str) -> None:
    with database.write() as transaction:
        for loss in range(1, jobs.MAX_LOSSES + 1):
            assert jobs.lose(transaction, claimed(transaction)) == (loss < jobs.MAX_LOSSES)
        failed = jobs.get_reconstruction(transaction, queued)
        assert (failed.state, failed.error) == ("failed", f"its process was lost {jobs.MAX_LOSSES} times")


def test_what_is_given_up_for_no_fault_of_its_own_is_tried_as_often_as_it_takes(
    database: Database, queued: str
) -> None:
    with database.write() as transaction:
        for attempt in range(1, 9):
            claim = claimed(transaction)
            assert claim == (queued, attempt)
            assert jobs.release(transaction, claim)


def test_cancelling(database: Database, queued: str) -> None:
    with database.write() as transaction:
        other = jobs.create_reconstruction(transaction, "s", ReconstructionParameters()).id
        assert jobs.request_cancel(transaction, other).state == "cancelled"
        with pytest.raises(Conflict, match="cancelled already"):
            jobs.request_cancel(transaction, other)
        claim = claimed(transaction)
        assert jobs.request_cancel(transaction, queued).state == "running"
        assert not jobs.report_progress(transaction, claim, "next", 0.5)
        assert not jobs.lose(transaction, claim)
        assert jobs.get_reconstruction(transaction, queued).state == "cancelled"
        with pytest.raises(NotFound):
            jobs.request_cancel(transaction, "none")


def test_who_waits_for_it_comes_first_then_who_came_first(database: Database, queued: str) -> None:
    with database.write() as transaction:
        second, third = (jobs.create_reconstruction(transaction, "s", ReconstructionParameters()).id for _ in range(2))
        transaction.get_one(ReconstructionRow, queued).priority = BATCH
        assert [claimed(transaction).id for _ in range(3)] == [second, third, queued]


def test_a_beat_goes_up_while_the_attempt_holds(database: Database, queued: str) -> None:
    with database.write() as transaction:
        claim = claimed(transaction)
        assert jobs.running(transaction) == {claim: 0}
        jobs.beat(transaction, [claim, jobs.Claim("none", 1)])
        assert jobs.running(transaction) == {claim: 1}
        jobs.lose(transaction, claim)
        assert jobs.running(transaction) == {}


def test_servers_that_claim_at_once_get_different_jobs(database: Database, database_url: str, queued: str) -> None:
    """Every job is claimed once, whoever asks; losing one at once on two servers counts one loss."""
    with database.write() as transaction:
        made = {jobs.create_reconstruction(transaction, "s", ReconstructionParameters()).id for _ in range(11)}
    servers = [Database(database_url) for _ in range(4)]

    def claim_all(server: Database) -> list[jobs.Claim]:
        found = []
        while True:
            with server.write() as transaction:
                claim = jobs.claim_next(transaction)
            if claim is None:
                return found
            found.append(claim)

    def lose_all(server: Database) -> None:
        for claim in sorted(claims):
            with server.write() as transaction:
                jobs.lose(transaction, claim)

    with ThreadPoolExecutor(4) as pool:
        claims = [claim for found in pool.map(claim_all, servers) for claim in found]
        assert sorted(claims) == sorted(jobs.Claim(job, 1) for job in {queued, *made})
        list(pool.map(lose_all, servers))
    with database.read() as transaction:
        rows = transaction.scalars(select(ReconstructionRow)).all()
        assert {(row.state, row.attempt, row.losses) for row in rows} == {("queued", 1, 1)}
    for server in servers:
        server.close()
