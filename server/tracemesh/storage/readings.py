"""Readings of fixed arrays: when they were taken, and what they measured, as sent."""

from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import NotFound
from tracemesh.storage.models import CurveRow, MessageRow, ReadingRow, RecordingRow
from tracemesh.storage.sessions import reading_count, session_row
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Device, Hello
from tracemesh.wire.resources import Readings


@dataclass(frozen=True)
class StoredReading:
    """One reading; `number` counts all of its session."""

    number: int
    recording: str
    device: Device
    reading: ArrayReading


def is_of_array(transaction: Transaction, session: str, number: int | None) -> bool:
    """Whether a reconstruction is of a reading: of number `number`, or because nothing else was measured."""
    scanned = select(CurveRow.index).where(CurveRow.session_id == session, CurveRow.samples > 0, ~CurveRow.removed)
    if number is not None:
        return True
    return transaction.scalar(scanned.limit(1)) is None and reading_count(transaction, session) > 0


def list_readings(transaction: Transaction, session: str, first: int, limit: int) -> Readings:
    """Times of the readings of a session from number `first` on; raises NotFound."""
    session_row(transaction, session)
    chosen = (ReadingRow.session_id == session) & (ReadingRow.index >= first)
    times = transaction.scalars(select(ReadingRow.time).where(chosen).order_by(ReadingRow.index).limit(limit))
    return Readings(count=reading_count(transaction, session), first=first, times=list(times))


def load_reading(transaction: Transaction, session: str, number: int | None = None) -> StoredReading:
    """A reading of a session, the last one by default; raises NotFound."""
    session_row(transaction, session)
    count = reading_count(transaction, session)
    row = transaction.get(ReadingRow, (session, count - 1 if number is None else number))
    if row is None:
        wanted = f"there is no reading {number}" if number is not None else "there are no readings"
        raise NotFound(f"{wanted} in session {session}: it has {count}")
    return _stored(transaction, row)


def newest_readings(transaction: Transaction, session: str) -> list[StoredReading]:
    """The last reading of each array of a session."""
    in_session = ReadingRow.session_id == session
    last = select(func.max(ReadingRow.index)).where(in_session).group_by(ReadingRow.recording_key)
    rows = transaction.scalars(select(ReadingRow).where(in_session, ReadingRow.index.in_(last)))
    return [_stored(transaction, row) for row in rows]


def _stored(transaction: Transaction, row: ReadingRow) -> StoredReading:
    recording = transaction.get_one(RecordingRow, row.recording_key)
    payload = transaction.get_one(MessageRow, (row.recording_key, row.seq)).payload
    device = Hello.model_validate_json(recording.hello).device
    return StoredReading(row.index, recording.id, device, ArrayReading.model_validate_json(payload))
