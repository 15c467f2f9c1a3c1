"""The job table. A row is the job; whatever runs it writes only while it holds the row's present attempt.

Several servers may share it. Each raises the beat of what it runs; whose beat stands still, as another server's own
clock measures it, is lost: no two clocks are compared.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

from sqlalchemy import ColumnElement, func, select, update
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import Conflict, NotFound
from tracemesh.storage.models import BATCH, INTERACTIVE, ArtifactRow, ReconstructionRow, new_id, now
from tracemesh.storage.paging import newest_first
from tracemesh.storage.sessions import session_row
from tracemesh.wire.resources import JobState, Reconstruction, ReconstructionParameters

MAX_LOSSES = 2
"""A job whose process or server was lost is run again, once."""
FIRST_STAGE = "reading"
UNFINISHED: tuple[JobState, ...] = ("queued", "running")


class Claim(NamedTuple):
    """An attempt at a reconstruction; whoever has it may write into the row as long as the row is at this attempt."""

    id: str
    attempt: int


def create_reconstruction(
    transaction: Transaction,
    session: str,
    parameters: ReconstructionParameters,
    identifier: str | None = None,
    batch: str | None = None,
) -> Reconstruction:
    """A queued reconstruction of a session, or the one that has this identifier already.

    One of a batch comes after those that somebody waits for.
    Raises NotFound, and Conflict when that one has other parameters.
    """
    session_row(transaction, session)
    known = transaction.get(ReconstructionRow, identifier) if identifier else None
    if known is not None:
        if known.parameters != parameters.model_dump():
            raise Conflict("the same Idempotency-Key came with other parameters before")
        return describe(transaction, known)
    row = ReconstructionRow(
        id=identifier or new_id(),
        session_id=session,
        batch_id=batch,
        priority=INTERACTIVE if batch is None else BATCH,
        parameters=parameters.model_dump(),
    )
    transaction.add(row)
    transaction.flush()
    return describe(transaction, row)


def give_artifact(transaction: Transaction, identifier: str, name: str, digest: str, size: int) -> Reconstruction:
    """Let a reconstruction have a file before it runs: a network that is known already.

    Raises NotFound, and Conflict when it has another one.
    """
    row = _row(transaction, identifier)
    known = transaction.get(ArtifactRow, (row.id, name))
    if known is not None and known.sha256 != digest:
        raise Conflict(f"the same Idempotency-Key came with another {name} before")
    if known is None:
        transaction.add(ArtifactRow(reconstruction_id=row.id, name=name, sha256=digest, size=size))
        transaction.flush()
    return describe(transaction, row)


def get_reconstruction(transaction: Transaction, identifier: str) -> Reconstruction:
    """One reconstruction; raises NotFound."""
    return describe(transaction, _row(transaction, identifier))


def list_reconstructions(
    transaction: Transaction,
    limit: int,
    after: str | None = None,
    *,
    session: str | None = None,
    batch: str | None = None,
    state: JobState | None = None,
) -> list[Reconstruction]:
    """Reconstructions of a session, of a batch or in a state, newest first; `after` is the last of the page before.

    Raises NotFound for an unknown one.
    """
    query = select(ReconstructionRow)
    if session is not None:
        session_row(transaction, session)
        query = query.where(ReconstructionRow.session_id == session)
    if batch is not None:
        query = query.where(ReconstructionRow.batch_id == batch)
    if state is not None:
        query = query.where(ReconstructionRow.state == state)
    last = None if after is None else _row(transaction, after)
    page = newest_first(query, ReconstructionRow, last, limit)
    return [describe(transaction, row) for row in transaction.scalars(page)]


def request_cancel(transaction: Transaction, identifier: str) -> Reconstruction:
    """Stop a reconstruction: at once when queued, after its present stage when running.

    Raises NotFound, and Conflict when it has ended.
    """
    row = transaction.get(ReconstructionRow, identifier, with_for_update=True, populate_existing=True)
    if row is None:
        raise _unknown(identifier)
    if row.state not in UNFINISHED:
        raise Conflict(f"reconstruction {identifier} is {row.state} already")
    row.cancel_requested = True
    if row.state == "queued":
        row.state, row.finished = "cancelled", now()
    transaction.flush()
    return describe(transaction, row)


def claim_next(transaction: Transaction) -> Claim | None:
    """Begin the next attempt at the job that is first in line; no other server gets the same one."""
    waiting = select(ReconstructionRow).where(ReconstructionRow.state == "queued")
    in_line = waiting.order_by(ReconstructionRow.priority, ReconstructionRow.created, ReconstructionRow.id).limit(1)
    row = transaction.scalar(in_line.with_for_update(skip_locked=True))
    if row is None:
        return None
    row.state, row.stage, row.fraction, row.attempt = "running", "", 0.0, row.attempt + 1
    return Claim(row.id, row.attempt)


def begin(transaction: Transaction, claim: Claim) -> bool:
    """Whether this is the first and only process that works on the attempt: a cluster may start one twice."""
    first = update(ReconstructionRow).where(_held(claim), ReconstructionRow.stage == "").values(stage=FIRST_STAGE)
    return transaction.scalar(first.returning(ReconstructionRow.cancel_requested)) is False


def beat(transaction: Transaction, claims: Collection[Claim]) -> None:
    """Say that somebody still watches over these attempts."""
    for claim in claims:
        transaction.execute(update(ReconstructionRow).where(_held(claim)).values(beat=ReconstructionRow.beat + 1))


def running(transaction: Transaction) -> dict[Claim, int]:
    """Attempts under way on any server, each with its beat."""
    columns = ReconstructionRow.id, ReconstructionRow.attempt, ReconstructionRow.beat
    rows = transaction.execute(select(*columns).where(ReconstructionRow.state == "running"))
    return {Claim(identifier, attempt): beat for identifier, attempt, beat in rows}


def count_waiting(transaction: Transaction) -> int:
    """Jobs that nobody has begun yet."""
    waiting = select(func.count()).select_from(ReconstructionRow).where(ReconstructionRow.state == "queued")
    return transaction.scalar(waiting) or 0


def release(transaction: Transaction, claim: Claim) -> bool:
    """Give up an attempt for no fault of the job, which waits again; False when it does not hold the row any more."""
    row = _locked(transaction, claim)
    if row is None:
        return False
    if row.cancel_requested:
        return finish(transaction, claim, "cancelled")
    row.state, row.stage, row.fraction = "queued", "", 0.0
    return True


def lose(transaction: Transaction, claim: Claim) -> bool:
    """The attempt's process or server was lost: try again, or give up after too many; whether it waits again."""
    row = _locked(transaction, claim)
    if row is None:
        return False
    row.losses += 1
    if row.losses >= MAX_LOSSES and not row.cancel_requested:
        finish(transaction, claim, "failed", f"its process was lost {row.losses} times")
        return False
    return release(transaction, claim) and row.state == "queued"


def report_progress(transaction: Transaction, claim: Claim, stage: str, fraction: float) -> bool:
    """Write progress; whether the attempt should go on."""
    progress = update(ReconstructionRow).where(_held(claim)).values(stage=stage, fraction=fraction)
    return transaction.scalar(progress.returning(ReconstructionRow.cancel_requested)) is False


def finish(
    transaction: Transaction,
    claim: Claim,
    state: JobState,
    error: str | None = None,
    artifacts: Mapping[str, tuple[str, int]] | None = None,
) -> bool:
    """End an attempt with its artifacts (name -> digest, size); False when it does not hold the row any more."""
    end = update(ReconstructionRow).where(_held(claim)).values(state=state, error=error, finished=now())
    if transaction.scalar(end.returning(ReconstructionRow.id)) is None:
        return False
    for name, (digest, size) in (artifacts or {}).items():
        transaction.add(ArtifactRow(reconstruction_id=claim.id, name=name, sha256=digest, size=size))
    return True


def describe(transaction: Transaction, row: ReconstructionRow) -> Reconstruction:
    """What the API tells of a reconstruction."""
    names = select(ArtifactRow.name).where(ArtifactRow.reconstruction_id == row.id)
    return Reconstruction(
        id=row.id,
        session=row.session_id,
        batch=row.batch_id,
        state=row.state,
        stage=row.stage,
        fraction=row.fraction,
        error=row.error,
        parameters=ReconstructionParameters.model_validate(row.parameters),
        created=row.created,
        finished=row.finished,
        artifacts={name: f"/api/v1/reconstructions/{row.id}/{name}" for name in transaction.scalars(names)},
    )


def _held(claim: Claim) -> ColumnElement[bool]:
    mine = (ReconstructionRow.id == claim.id) & (ReconstructionRow.attempt == claim.attempt)
    return mine & (ReconstructionRow.state == "running")


def _locked(transaction: Transaction, claim: Claim) -> ReconstructionRow | None:
    """The row of an attempt that still holds it; nobody else changes it meanwhile."""
    return transaction.scalar(select(ReconstructionRow).where(_held(claim)).with_for_update())


def _row(transaction: Transaction, identifier: str) -> ReconstructionRow:
    row = transaction.get(ReconstructionRow, identifier)
    if row is None:
        raise _unknown(identifier)
    return row


def _unknown(identifier: str) -> NotFound:
    return NotFound(f"there is no reconstruction {identifier}")
