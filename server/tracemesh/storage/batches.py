"""Batches: many scans sent at once, each with a session and a reconstruction of its own, after what is waited for."""

from collections import Counter

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import Conflict, NotFound
from tracemesh.storage.models import ArtifactRow, BatchRow, ReconstructionRow, SessionRow
from tracemesh.storage.paging import newest_first
from tracemesh.storage.reconstructions import UNFINISHED, request_cancel
from tracemesh.wire.resources import Batch, Reconstruction


def create_batch(transaction: Transaction, identifier: str, name: str, size: int) -> Batch:
    """A new batch of so many scans, or the one that has this identifier already.

    Raises Conflict when that one has another size.
    """
    row = transaction.get(BatchRow, identifier)
    if row is None:
        row = BatchRow(id=identifier, name=name, size=size)
        transaction.add(row)
        transaction.flush()
    elif row.size != size:
        raise Conflict(f"the same Idempotency-Key came with {row.size} scans before, now with {size}")
    return _batch(transaction, row)


def get_batch(transaction: Transaction, identifier: str) -> Batch:
    """One batch, with how far it is; raises NotFound."""
    return _batch(transaction, _row(transaction, identifier))


def list_batches(transaction: Transaction, limit: int, after: str | None = None) -> list[Batch]:
    """Newest first; `after` is the last batch of the page before. Raises NotFound for an unknown one."""
    last = None if after is None else _row(transaction, after)
    return [
        _batch(transaction, row) for row in transaction.scalars(newest_first(select(BatchRow), BatchRow, last, limit))
    ]


def cancel_batch(transaction: Transaction, identifier: str) -> tuple[Batch, list[Reconstruction]]:
    """Stop everything of a batch that has not ended: the batch, and what was stopped; raises NotFound."""
    row = _row(transaction, identifier)
    unfinished = select(ReconstructionRow.id).where(
        ReconstructionRow.batch_id == identifier, ReconstructionRow.state.in_(UNFINISHED)
    )
    stopped = []
    for job in transaction.scalars(unfinished).all():
        try:
            stopped.append(request_cancel(transaction, job))
        except Conflict:  # it has ended meanwhile
            continue
    return _batch(transaction, row), stopped


def batch_results(transaction: Transaction, identifier: str) -> list[tuple[str, str, str, str]]:
    """Session, name of the scan, name of the file and digest of every file that is done, in the order of the scans.

    Raises NotFound.
    """
    _row(transaction, identifier)
    query = (
        select(SessionRow.id, SessionRow.name, ArtifactRow.name, ArtifactRow.sha256)
        .join(ReconstructionRow, ReconstructionRow.id == ArtifactRow.reconstruction_id)
        .join(SessionRow, SessionRow.id == ReconstructionRow.session_id)
        .where(ReconstructionRow.batch_id == identifier, ReconstructionRow.state == "done")
        .order_by(ReconstructionRow.created, ReconstructionRow.id, ArtifactRow.name)
    )
    return [(session, scan, name, digest) for session, scan, name, digest in transaction.execute(query)]


def _row(transaction: Transaction, identifier: str) -> BatchRow:
    row = transaction.get(BatchRow, identifier)
    if row is None:
        raise NotFound(f"there is no batch {identifier}")
    return row


def _batch(transaction: Transaction, row: BatchRow) -> Batch:
    mine = ReconstructionRow.batch_id == row.id
    columns = ReconstructionRow.state, func.count(), func.coalesce(func.sum(ReconstructionRow.fraction), 0.0)
    counts: Counter[str] = Counter()
    worked = 0.0
    for state, count, fraction in transaction.execute(select(*columns).where(mine).group_by(ReconstructionRow.state)):
        counts[state] = count
        worked += fraction if state in UNFINISHED else count
    return Batch(
        id=row.id,
        name=row.name,
        created=row.created,
        size=row.size,
        queued=counts["queued"],
        running=counts["running"],
        done=counts["done"],
        failed=counts["failed"],
        cancelled=counts["cancelled"],
        fraction=min(1.0, worked / row.size),
    )
