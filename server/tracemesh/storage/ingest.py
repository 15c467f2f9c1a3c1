"""From accepted messages to committed rows: many devices' messages in one transaction, acknowledged only after it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sqlalchemy import bindparam, delete, func, insert, select
from sqlalchemy.orm import Session

from tracemesh.errors import Overtaken, Refused
from tracemesh.storage.bulk import insert_all, update_each
from tracemesh.storage.devices import add_calibration, corrected_hello, seen
from tracemesh.storage.models import CurveRow, MarkRow, MessageRow, ReadingRow, RecordingRow, SessionRow, new_id
from tracemesh.storage.states import CurveState, RecordingState, SessionState
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.base import PROTOCOL_VERSION
from tracemesh.wire.device import CurveEnd, CurveStart, Hello, NodeMark, OfCurve, Recorded

Row = dict[str, Any]
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
    marked: dict[int, str] = field(default_factory=dict)
    """Sessions of the recordings whose marks change."""

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
            self.marked[key] = state.session.id
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

    def drop(self, key: int) -> None:
        """Leave a recording out after all."""
        for rows in (self.messages, self.starts, self.marks, self.unmarks, self.ends, self.readings):
            rows[:] = [
                row
                for row in rows
                if key not in (row.get("recording_key"), row.get("at_key"), row.get("at_recording_key"))
            ]
        for curve in [curve for curve in self.travelled if curve[0] == key]:
            del self.travelled[curve]
        self.reached.pop(key, None)
        self.marked.pop(key, None)


def commit(session: Session, group: Group, owner: str = "") -> None:
    """Write all rows of a group; the caller commits.

    Raises Overtaken when another server than `owner` has a recording now, or gave a new curve's index away.
    """
    _lock_sessions(session, {row["session_id"] for row in [*group.starts, *group.readings]} | {*group.marked.values()})
    _check_indices(session, group.starts)
    _number(session, group.readings)
    _reach(session, group, owner)
    connection = session.connection()
    this_curve = {"at_key": CurveRow.recording_key, "at_number": CurveRow.number}
    insert_all(connection, MessageRow, group.messages)
    insert_all(connection, ReadingRow, group.readings)
    statements = (
        (insert(CurveRow), group.starts),
        (delete(MarkRow).where(*(getattr(MarkRow, name) == bindparam(f"at_{name}") for name in MARK)), group.unmarks),
        (insert(MarkRow), group.marks),
    )
    for statement, rows in statements:
        if rows:
            connection.execute(statement, rows)
    update_each(connection, CurveRow, this_curve, list(group.travelled.values()))
    update_each(connection, CurveRow, this_curve, group.ends)


def _lock_sessions(session: Session, identifiers: set[str]) -> None:
    """Nobody starts a curve, counts a reading or edits marks in these sessions until this transaction ends."""
    if identifiers:
        these = select(SessionRow.id).where(SessionRow.id.in_(identifiers))
        # all servers lock them in the same order
        session.execute(these.order_by(SessionRow.id).with_for_update(key_share=True)).all()


def _number(session: Session, readings: list[Row]) -> None:
    """Go on from the last reading that is stored: another server may count those of the same session, too."""
    if not readings:
        return
    of_these = ReadingRow.session_id.in_({row["session_id"] for row in readings})
    last = select(ReadingRow.session_id, func.max(ReadingRow.index)).where(of_these).group_by(ReadingRow.session_id)
    reached = dict(session.execute(last).all())
    for row in readings:
        row["index"] = reached[row["session_id"]] = reached.get(row["session_id"], -1) + 1


def _check_indices(session: Session, starts: list[Row]) -> None:
    identifiers = {row["session_id"] for row in starts}
    if not identifiers:
        return
    taken = set(
        session.execute(select(CurveRow.session_id, CurveRow.index).where(CurveRow.session_id.in_(identifiers)))
    )
    again = Refused("storage", "another server started a curve in the same session; connect again")
    if reasons := {row["recording_key"]: again for row in starts if (row["session_id"], row["index"]) in taken}:
        raise Overtaken(reasons)


def _reach(session: Session, group: Group, owner: str) -> None:
    own = {"at_key": RecordingRow.key, "at_owner": RecordingRow.owner}
    rows = [{**reached._asdict(), "at_owner": owner} for reached in group.reached.values()]
    if update_each(session.connection(), RecordingRow, own, rows) != len(rows):
        present = select(RecordingRow.key, RecordingRow.owner).where(RecordingRow.key.in_(group.reached))
        owners = dict(session.execute(present).all())
        raise Overtaken({key: _why_not(owners.get(key)) for key in group.reached if owners.get(key) != owner})


def _why_not(owner: str | None) -> Refused:
    if owner is None:
        return Refused("unknown", "the recording was deleted")
    return Refused("limit", "the recording goes on over another connection")


def record(session: Session, hello: Hello, payload: bytes, messages: Iterable[tuple[Recorded, bytes]]) -> None:
    """A whole recording at once; the caller commits. Raises Refused for what contradicts itself."""
    state, group = open_recording(session, hello, payload), Group()
    for message, line in messages:
        state.check(message)
        state.advance(message, len(line))
        group.add(state, message, line)
    commit(session, group)


def open_recording(session: Session, hello: Hello, payload: bytes, owner: str = "") -> RecordingState:
    """The recording that a hello names, made when it is new; from now on only `owner` may write into it.

    Raises Refused when no version of the protocol is common or the session that the hello names does not exist.
    """
    if PROTOCOL_VERSION not in hello.versions:
        raise Refused("version", f"this server speaks version {PROTOCOL_VERSION}, the device speaks {hello.versions}")
    seen(session, hello.device)
    row = _find(session, hello) or _create(session, hello, payload)
    before, row.owner = row.owner, owner
    session.flush()
    return RecordingState(
        key=row.key,
        session=_session_state(session, row.session_id),
        hello=corrected_hello(session, row),
        next_seq=row.next_seq,
        committed=row.next_seq,
        bytes=row.bytes,
        curves=_curve_states(session, row.key),
        taken_over=before not in ("", owner),
    )


def _find(session: Session, hello: Hello) -> RecordingRow | None:
    """A hello without a session goes on with the recording for which the server made one."""
    query = select(RecordingRow).where(RecordingRow.id == hello.recording)
    if hello.session is None:
        return session.scalar(query.where(RecordingRow.made_session).with_for_update())
    return session.scalar(query.where(RecordingRow.session_id == hello.session).with_for_update())


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
