"""The job table. A row is the job; whatever runs it writes only while it holds the row's present attempt."""

from collections.abc import Mapping

from sqlalchemy import ColumnElement, select, update
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import Conflict, NotFound
from tracemesh.storage.models import ArtifactRow, ReconstructionRow, new_id, now
from tracemesh.storage.sessions import session_row
from tracemesh.wire.resources import JobState, Reconstruction, ReconstructionParameters

MAX_ATTEMPTS = 3
"""A job whose process or server was lost is run again, but not for ever."""
UNFINISHED: tuple[JobState, ...] = ("queued", "running")


def create_reconstruction(
    transaction: Transaction, session: str, parameters: ReconstructionParameters, identifier: str | None = None
) -> Reconstruction:
    """A queued reconstruction of a session, or the one that has this identifier already.

    Raises NotFound, and Conflict when that one has other parameters.
    """
    session_row(transaction, session)
    known = transaction.get(ReconstructionRow, identifier) if identifier else None
    if known is not None:
        if known.parameters != parameters.model_dump():
            raise Conflict("the same Idempotency-Key came with other parameters before")
        return describe(transaction, known)
    row = ReconstructionRow(id=identifier or new_id(), session_id=session, parameters=parameters.model_dump())
    transaction.add(row)
    transaction.flush()
    return describe(transaction, row)


def give_artifact(transaction: Transaction, identifier: str, name: str, digest: str, size: int) -> Reconstruction:
    """Let a reconstruction have a file before it runs: a network that is known already. Raises NotFound."""
    row = _row(transaction, identifier)
    transaction.add(ArtifactRow(reconstruction_id=row.id, name=name, sha256=digest, size=size))
    transaction.flush()
    return describe(transaction, row)


def get_reconstruction(transaction: Transaction, identifier: str) -> Reconstruction:
    """One reconstruction; raises NotFound."""
    return describe(transaction, _row(transaction, identifier))


def list_reconstructions(transaction: Transaction, session: str) -> list[Reconstruction]:
    """All reconstructions of a session, newest first; raises NotFound."""
    session_row(transaction, session)
    query = select(ReconstructionRow).where(ReconstructionRow.session_id == session)
    newest_first = query.order_by(ReconstructionRow.created.desc(), ReconstructionRow.id.desc())
    return [describe(transaction, row) for row in transaction.scalars(newest_first)]


def request_cancel(transaction: Transaction, identifier: str) -> Reconstruction:
    """Stop a reconstruction: at once when queued, after its present stage when running.

    Raises NotFound, and Conflict when it has ended.
    """
    row = _row(transaction, identifier)
    if row.state not in UNFINISHED:
        raise Conflict(f"reconstruction {identifier} is {row.state} already")
    row.cancel_requested = True
    if row.state == "queued":
        row.state, row.finished = "cancelled", now()
    transaction.flush()
    return describe(transaction, row)


def requeue_unfinished(transaction: Transaction) -> list[str]:
    """At start nothing runs yet: rows that say so were lost with the server. All that wait, oldest first."""
    running = transaction.scalars(select(ReconstructionRow).where(ReconstructionRow.state == "running"))
    for row in running:
        requeue(transaction, row.id, row.attempt)
    transaction.flush()
    waiting = select(ReconstructionRow.id).where(ReconstructionRow.state == "queued")
    return list(transaction.scalars(waiting.order_by(ReconstructionRow.created)))


def claim(transaction: Transaction, identifier: str) -> int | None:
    """Begin the next attempt; its number, or None when the row does not wait any more."""
    row = transaction.get(ReconstructionRow, identifier)
    if row is None or row.state != "queued":
        return None
    row.state, row.stage, row.fraction, row.attempt = "running", "", 0.0, row.attempt + 1
    return row.attempt


def requeue(transaction: Transaction, identifier: str, attempt: int) -> bool:
    """The attempt's worker was lost: try again, or give up after too many; whether it waits again."""
    row = transaction.get(ReconstructionRow, identifier)
    if row is None or (row.state, row.attempt) != ("running", attempt):
        return False
    if row.cancel_requested:
        finish(transaction, identifier, attempt, "cancelled")
    elif attempt >= MAX_ATTEMPTS:
        finish(transaction, identifier, attempt, "failed", f"its process was lost {attempt} times")
    else:
        row.state, row.stage, row.fraction = "queued", "", 0.0
        return True
    return False


def report_progress(transaction: Transaction, identifier: str, attempt: int, stage: str, fraction: float) -> bool:
    """Write progress; whether the attempt should go on."""
    progress = update(ReconstructionRow).where(_held(identifier, attempt)).values(stage=stage, fraction=fraction)
    return transaction.scalar(progress.returning(ReconstructionRow.cancel_requested)) is False


def finish(
    transaction: Transaction,
    identifier: str,
    attempt: int,
    state: JobState,
    error: str | None = None,
    artifacts: Mapping[str, tuple[str, int]] | None = None,
) -> bool:
    """End an attempt with its artifacts (name -> digest, size); False when it does not hold the row any more."""
    end = update(ReconstructionRow).where(_held(identifier, attempt)).values(state=state, error=error, finished=now())
    if transaction.scalar(end.returning(ReconstructionRow.id)) is None:
        return False
    for name, (digest, size) in (artifacts or {}).items():
        transaction.add(ArtifactRow(reconstruction_id=identifier, name=name, sha256=digest, size=size))
    return True


def describe(transaction: Transaction, row: ReconstructionRow) -> Reconstruction:
    """What the API tells of a reconstruction."""
    names = select(ArtifactRow.name).where(ArtifactRow.reconstruction_id == row.id)
    return Reconstruction(
        id=row.id,
        session=row.session_id,
        state=row.state,
        stage=row.stage,
        fraction=row.fraction,
        error=row.error,
        parameters=ReconstructionParameters.model_validate(row.parameters),
        created=row.created,
        finished=row.finished,
        artifacts={name: f"/api/v1/reconstructions/{row.id}/{name}" for name in transaction.scalars(names)},
    )


def _held(identifier: str, attempt: int) -> ColumnElement[bool]:
    mine = (ReconstructionRow.id == identifier) & (ReconstructionRow.attempt == attempt)
    return mine & (ReconstructionRow.state == "running")


def _row(transaction: Transaction, identifier: str) -> ReconstructionRow:
    row = transaction.get(ReconstructionRow, identifier)
    if row is None:
        raise NotFound(f"there is no reconstruction {identifier}")
    return row
