"""Sessions: the objects being scanned."""

from typing import Any

from sqlalchemy import BigInteger, Row, Select, SQLColumnExpression, cast, delete, func, select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import Conflict, NotFound
from tracemesh.storage.models import CurveRow, MarkRow, ReadingRow, ReconstructionRow, SessionRow, new_id
from tracemesh.storage.paging import newest_first
from tracemesh.wire.resources import Session, SessionCreate, SessionUpdate


def create_session(transaction: Transaction, wanted: SessionCreate, derived: str | None = None) -> Session:
    """A new session, or the one that has the identifier `derived` from an idempotency key already.

    Raises Conflict when the identifier that the caller wants is taken.
    """
    identifier = wanted.id or derived or new_id()
    if wanted.id is None and derived is not None and (known := transaction.get(SessionRow, derived)) is not None:
        return _session(transaction, known)
    if transaction.get(SessionRow, identifier) is not None:
        raise Conflict(f"there is a session {identifier} already")
    row = SessionRow(id=identifier, name=wanted.name)
    transaction.add(row)
    transaction.flush()
    return _session(transaction, row)


def list_sessions(transaction: Transaction, limit: int, after: str | None = None, name: str = "") -> list[Session]:
    """Newest first, those whose name contains `name`; `after` is the last session of the page before.

    Raises NotFound for an unknown one.
    """
    query = _with_counts()
    if name:
        query = query.where(SessionRow.name.icontains(name, autoescape=True))
    last = None if after is None else session_row(transaction, after)
    return [_described(row) for row in transaction.execute(newest_first(query, SessionRow, last, limit))]


def get_session(transaction: Transaction, identifier: str) -> Session:
    """One session; raises NotFound."""
    return _session(transaction, session_row(transaction, identifier))


def update_session(transaction: Transaction, identifier: str, change: SessionUpdate) -> Session:
    """Change what the update names; raises NotFound."""
    row = session_row(transaction, identifier)
    if change.name is not None:
        row.name = change.name
    return _session(transaction, row)


def delete_session(transaction: Transaction, identifier: str) -> None:
    """Delete a session with everything in it; raises NotFound."""
    session_row(transaction, identifier)
    transaction.execute(delete(SessionRow).where(SessionRow.id == identifier))


def reading_count(transaction: Transaction, identifier: str) -> int:
    """Readings of fixed arrays in a session: they are numbered from 0 without a gap."""
    last = transaction.scalar(_last_reading(identifier))
    return 0 if last is None else last + 1


def lock_session(transaction: Transaction, identifier: str) -> None:
    """Keep others from editing a session, or its curves, until the transaction ends; raises NotFound."""
    query = select(SessionRow.id).where(SessionRow.id == identifier).with_for_update()
    if transaction.scalar(query) is None:
        raise NotFound(f"there is no session {identifier}")


def session_row(transaction: Transaction, identifier: str) -> SessionRow:
    """Row of a session; raises NotFound."""
    row = transaction.get(SessionRow, identifier)
    if row is None:
        raise NotFound(f"there is no session {identifier}")
    return row


def _session(transaction: Transaction, row: SessionRow) -> Session:
    return _described(transaction.execute(_with_counts().where(SessionRow.id == row.id)).one())


def _described(found: Row[Any]) -> Session:
    session = found.SessionRow
    return Session(
        id=session.id,
        name=session.name,
        created=session.created,
        curves=found.curves,
        samples=found.samples,
        nodes=found.nodes,
        readings=0 if found.last_reading is None else found.last_reading + 1,
        latest_reconstruction=found.latest,
    )


def _with_counts() -> Select[*tuple[Any, ...]]:
    """Sessions with what is in each, as `_described` takes it: one query for however many."""
    kept = (CurveRow.session_id == SessionRow.id) & ~CurveRow.removed
    same_curve = (MarkRow.recording_key == CurveRow.recording_key) & (MarkRow.number == CurveRow.number)
    done = (ReconstructionRow.session_id == SessionRow.id) & (ReconstructionRow.state == "done")
    latest = select(ReconstructionRow.id).where(done).order_by(ReconstructionRow.created.desc()).limit(1)
    samples = cast(func.coalesce(func.sum(CurveRow.samples), 0), BigInteger)
    nodes = select(func.count(MarkRow.node.distinct())).join_from(MarkRow, CurveRow, same_curve).where(kept)
    return select(
        SessionRow,
        select(func.count()).select_from(CurveRow).where(kept).scalar_subquery().label("curves"),
        select(samples).where(kept).scalar_subquery().label("samples"),
        nodes.scalar_subquery().label("nodes"),
        _last_reading(SessionRow.id).scalar_subquery().label("last_reading"),
        latest.scalar_subquery().label("latest"),
    )


def _last_reading(session: SQLColumnExpression[str] | str) -> Select[Any]:
    return select(func.max(ReadingRow.index)).where(ReadingRow.session_id == session)
