"""From accepted messages to committed rows: many devices' messages in one transaction, acknowledged only after it."""

from dataclasses import dataclass, field
from typing import NamedTuple

from sqlalchemy import bindparam, delete, func, insert, select, update
from sqlalchemy.orm import Session

from tracemesh.errors import Refused
from tracemesh.storage.devices import add_calibration, corrected_hello, seen
from tracemesh.storage.models import CurveRow, MarkRow, MessageRow, ReadingRow, RecordingRow, SessionRow, new_id
from tracemesh.storage.states import CurveState, RecordingState, SessionState
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.base import PROTOCOL_VERSION
from tracemesh.wire.device import CurveEnd, CurveStart, Hello, NodeMark, OfCurve, Recorded

Row = dict[str, object]
MARK = ("recording_key", "number", "sample", "node")
"""What tells a mark from others."""


class Reached(NamedTuple):
    """How far a recording is with a group."""

    at_key: int
    next_seq: int
    bytes: int


@dataclass(frozen=True)
class Group:
    """Rows of any number of recordings that are committed together."""

    messages: list[Row] = field(default_factory=list)
    starts: list[Row] = field(default_factory=list)
    marks: list[Row] = field(default_factory=list)
    unmarks: list[Row] = field(default_factory=list)
    ends: list[Row] = field(default_factory=list)
    readings: list[Row] = field(default_factory=list)
    travelled: dict[tuple[int, int], Row] = field(default_factory=dict)
    reached: dict[int, Reached] = field(default_factory=dict)

    def add(self, state: RecordingState, message: Recorded, payload: bytes) -> None:
        """Take a message that `state` has just advanced over."""
        key = state.key
        self.messages.append({"recording_key": key, "seq": message.seq, "payload": payload})
        self.acknowledge(state)
        if isinstance(message, ArrayReading):
            index = state.session.next_reading - 1
            row: Row = {"session_id": state.session.id, "index": index, "recording_key": key, "seq": message.seq}
            self.readings.append({**row, "time": message.time})
        else:
            self._add_of_curve(state, message)

    def _add_of_curve(self, state: RecordingState, message: OfCurve) -> None:
        key, number = state.key, message.curve
        row: Row = {"recording_key": key, "number": number}
        curve: Row = {"at_key": key, "at_number": number}
        if isinstance(message, CurveStart):
            index = state.curves[number].index
            self.starts.append({**row, "session_id": state.session.id, "index": index, "boundary": message.boundary})
        elif isinstance(message, NodeMark):
            self._mark({**row, "sample": message.sample, "node": message.node}, message.undo)
        elif isinstance(message, CurveEnd):
            self.ends.append({**curve, "closed": message.closed, "removed": message.discard, "ended": True})
        else:
            now = state.curves[number]
            travelled: Row = {"samples": now.samples, "length": now.length, "odometer": now.odometer}
            self.travelled[key, number] = curve | travelled

    def _mark(self, row: Row, undo: bool) -> None:
        if not undo:
            self.marks.append(row)
        elif row in self.marks:
            self.marks.remove(row)
        else:
            self.unmarks.append({f"at_{name}": value for name, value in row.items()})

    def acknowledge(self, state: RecordingState) -> None:
        """Have the recording acknowledged with this group, though it may add nothing to it."""
        self.reached[state.key] = Reached(state.key, state.next_seq, state.bytes)


def commit(session: Session, group: Group) -> None:
    """Write all rows of a group; the caller commits."""
    connection = session.connection()
    this_curve = (CurveRow.recording_key == bindparam("at_key")) & (CurveRow.number == bindparam("at_number"))
    statements = (
        (insert(MessageRow), group.messages),
        (insert(CurveRow), group.starts),
        (delete(MarkRow).where(*(getattr(MarkRow, name) == bindparam(f"at_{name}") for name in MARK)), group.unmarks),
        (insert(MarkRow), group.marks),
        (update(CurveRow).where(this_curve), list(group.travelled.values())),
        (update(CurveRow).where(this_curve), group.ends),
        (insert(ReadingRow), group.readings),
        (
            update(RecordingRow).where(RecordingRow.key == bindparam("at_key")),
            [r._asdict() for r in group.reached.values()],
        ),
    )
    for statement, rows in statements:
        if rows:
            connection.execute(statement, rows)


def open_recording(session: Session, hello: Hello, payload: bytes) -> RecordingState:
    """The recording that a hello names, made when it is new.

    Raises Refused when no version of the protocol is common or the session that the hello names does not exist.
    """
    if PROTOCOL_VERSION not in hello.versions:
        raise Refused("version", f"this server speaks version {PROTOCOL_VERSION}, the device speaks {hello.versions}")
    seen(session, hello.device)
    row = _find(session, hello) or _create(session, hello, payload)
    return RecordingState(
        key=row.key,
        session=_session_state(session, row.session_id),
        hello=corrected_hello(session, row),
        next_seq=row.next_seq,
        committed=row.next_seq,
        bytes=row.bytes,
        curves=_curve_states(session, row.key),
    )


def _find(session: Session, hello: Hello) -> RecordingRow | None:
    """A hello without a session goes on with the recording for which the server made one."""
    query = select(RecordingRow).where(RecordingRow.id == hello.recording)
    if hello.session is None:
        return session.scalar(query.where(RecordingRow.made_session))
    return session.scalar(query.where(RecordingRow.session_id == hello.session))


def _create(session: Session, hello: Hello, payload: bytes) -> RecordingRow:
    made = hello.session is None
    identifier = hello.session or new_id()
    if made:
        session.add(SessionRow(id=identifier, name=hello.device.name))
        session.flush()
    elif session.get(SessionRow, identifier) is None:
        raise Refused("unknown", f"there is no session {identifier}")
    row = RecordingRow(id=hello.recording, session_id=identifier, hello=payload, made_session=made)
    if hello.device.calibration is not None:
        row.calibration = add_calibration(session, hello.device.calibration).version
    session.add(row)
    session.flush()
    return row


def _session_state(session: Session, identifier: str) -> SessionState:
    last = session.scalar(select(func.max(CurveRow.index)).where(CurveRow.session_id == identifier))
    newest = session.scalar(select(func.max(ReadingRow.index)).where(ReadingRow.session_id == identifier))
    size = session.scalar(select(func.sum(RecordingRow.bytes)).where(RecordingRow.session_id == identifier))
    return SessionState(identifier, _after(last), _after(newest), int(size or 0))


def _after(index: int | None) -> int:
    return 0 if index is None else index + 1


def _curve_states(session: Session, key: int) -> dict[int, CurveState]:
    rows = session.scalars(select(CurveRow).where(CurveRow.recording_key == key))
    return {row.number: CurveState(row.index, row.samples, row.length, row.odometer, row.ended) for row in rows}
