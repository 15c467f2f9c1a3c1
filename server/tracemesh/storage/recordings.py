"""Recordings: what devices sent, as sent."""

from collections.abc import Iterator

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import NotFound
from tracemesh.storage.devices import choose_calibration
from tracemesh.storage.models import MessageRow, RecordingRow
from tracemesh.storage.sessions import session_row
from tracemesh.wire.device import Hello
from tracemesh.wire.resources import RecordingSummary, RecordingUpdate

PAGE = 200
"""Messages read at once."""


def list_recordings(
    transaction: Transaction, session: str, limit: int, after: str | None = None
) -> list[RecordingSummary]:
    """At most `limit` recordings of a session as they began, those after a certain one; raises NotFound."""
    session_row(transaction, session)
    begun = 0 if after is None else recording_row(transaction, session, after).key
    own = (RecordingRow.session_id == session) & (RecordingRow.key > begun)
    query = select(RecordingRow).where(own).order_by(RecordingRow.key).limit(limit)
    return [summary(row) for row in transaction.scalars(query)]


def recording_row(transaction: Transaction, session: str, identifier: str) -> RecordingRow:
    """Row of a recording; raises NotFound."""
    query = select(RecordingRow).where(RecordingRow.session_id == session, RecordingRow.id == identifier)
    row = transaction.scalar(query)
    if row is None:
        raise NotFound(f"there is no recording {identifier} in session {session}")
    return row


def update_recording(
    transaction: Transaction, session: str, identifier: str, change: RecordingUpdate
) -> RecordingSummary:
    """Change what the update names; raises NotFound."""
    row = recording_row(transaction, session, identifier)
    if "calibration" in change.model_fields_set:
        choose_calibration(transaction, row, change.calibration)
    return summary(row)


def recording_messages(transaction: Transaction, key: int, first: int = 0) -> Iterator[bytes]:
    """Committed messages of a recording from number `first` on, byte for byte."""
    while True:
        query = select(MessageRow.payload).where(MessageRow.recording_key == key, MessageRow.seq >= first)
        page = transaction.scalars(query.order_by(MessageRow.seq).limit(PAGE)).all()
        yield from page
        if len(page) < PAGE:
            return
        first += PAGE


def summary(row: RecordingRow) -> RecordingSummary:
    """What the API tells of a recording."""
    return RecordingSummary(
        id=row.id,
        session=row.session_id,
        device=Hello.model_validate_json(row.hello).device,
        messages=row.next_seq,
        bytes=row.bytes,
        created=row.created,
        calibration=row.calibration,
    )
