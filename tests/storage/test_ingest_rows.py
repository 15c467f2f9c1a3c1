"""Laws of ingest: what is stored does not depend on how it was grouped, nor on restarts in between."""

from collections.abc import Iterator
from dataclasses import asdict
from threading import Thread

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import event, select
from sqlalchemy.orm import Session

from tracemesh.errors import Overtaken, Refused
from tracemesh.storage.curves import get_curve, list_curves, update_curve
from tracemesh.storage.database import Database
from tracemesh.storage.devices import list_devices, seen
from tracemesh.storage.ingest import Group, commit, open_recording
from tracemesh.storage.models import MessageRow, RecordingRow, SessionRow, new_id
from tracemesh.storage.readings import list_readings
from tracemesh.storage.recordings import recording_messages, recording_row
from tracemesh.storage.sessions import delete_session, lock_session
from tracemesh.storage.states import RecordingState
from tracemesh.wire.arrays import ArrayCurve, ArrayReading, SensorArray
from tracemesh.wire.base import Count
from tracemesh.wire.device import CurveEnd, CurveStart, Device, Hello, NodeMark, Recorded, Samples, Wheel
from tracemesh.wire.resources import CurveUpdate, Mark

HELLO = Hello(recording="r", device=Device(id="d", kind="test", wheel=Wheel(circumference=0.1, ticks_per_turn=500)))
FLAT = {"tangent": [(1.0, 0.0, 0.0)], "normal": [(0.0, 0.0, 1.0)]}


@st.composite
def rides(draw: st.DrawFn) -> list[Recorded]:
    """Valid messages of up to four curves, in any order that the protocol allows."""
    messages: list[Recorded] = []
    counts: dict[int, int] = {}
    marks: list[tuple[int, int, int]] = []
    ended: set[int] = set()
    for _ in range(draw(st.integers(1, 40))):
        curve = draw(st.integers(0, 3))
        kind = draw(st.sampled_from(["samples", "samples", "node", "undo", "end"]))
        seq: Count = len(messages)
        if curve not in counts:
            messages.append(CurveStart(seq=seq, curve=curve, boundary=draw(st.booleans())))
            counts[curve] = 0
        elif kind == "samples" and curve not in ended:
            ticks = [(draw(st.integers(0, 65535)), draw(st.integers(0, 499)))]
            messages.append(Samples(seq=seq, curve=curve, first_sample=counts[curve], ticks=ticks, **FLAT))
            counts[curve] += 1
        elif kind == "node" and counts[curve]:
            mark = (curve, draw(st.integers(0, counts[curve] - 1)), draw(st.integers(0, 5)))
            if mark not in marks:
                marks.append(mark)
                messages.append(NodeMark(seq=seq, curve=curve, sample=mark[1], node=mark[2]))
        elif kind == "undo" and marks:
            mark = marks.pop(draw(st.integers(0, len(marks) - 1)))
            messages.append(NodeMark(seq=seq, curve=mark[0], sample=mark[1], node=mark[2], undo=True))
        elif kind == "end" and curve not in ended:
            messages.append(CurveEnd(seq=seq, curve=curve, closed=draw(st.booleans())))
            ended.add(curve)
    return messages


def store(
    database: Database, hello: Hello, messages: list[Recorded], groups: list[int], restart: bool
) -> RecordingState:
    """Commit in groups that end before these numbers, forgetting everything in between if `restart`."""
    state: RecordingState | None = None
    for first, last in zip([0, *groups], [*groups, len(messages)], strict=True):
        if state is None or restart:
            with database.write() as transaction:
                state = open_recording(transaction, hello, hello.model_dump_json().encode())
        group = Group()
        for message in messages[first:last]:
            payload = message.model_dump_json(exclude_none=True).encode()
            state.check(message)
            state.advance(message, len(payload))
            group.add(state, message, payload)
        with database.write() as transaction:
            commit(transaction, group)
    assert state is not None
    return state


def known(state: RecordingState) -> tuple[object, ...]:
    """What a state knows, less the names that differ from run to run."""
    curves = {number: asdict(curve) for number, curve in state.curves.items()}
    return state.next_seq, state.bytes, state.session.next_index, state.session.bytes, curves


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rides(), st.data())
def test_groups_and_restarts_do_not_matter(database: Database, messages: list[Recorded], data: st.DataObject) -> None:
    cuts = sorted(data.draw(st.lists(st.integers(0, len(messages)), max_size=4)))
    one = HELLO.model_copy(update={"recording": new_id()})
    two = HELLO.model_copy(update={"recording": new_id()})
    whole = store(database, one, messages, [], restart=False)
    pieces = store(database, two, messages, cuts, restart=True)
    assert known(whole) == known(pieces)
    with database.write() as transaction:
        assert known(open_recording(transaction, two, b"")) == known(pieces)
        assert list(recording_messages(transaction, whole.key)) == list(recording_messages(transaction, pieces.key))
        curves = [list_curves(transaction, s.session.id) for s in (whole, pieces)]
        assert [c.model_copy(update={"recording": "x"}) for c in curves[0]] == [
            c.model_copy(update={"recording": "x"}) for c in curves[1]
        ]
        assert sorted((c.index, m.sample, m.node) for c in curves[0] for m in c.marks) == marks_obviously(messages)


def marks_obviously(messages: list[Recorded]) -> list[tuple[int, int, int]]:
    """Marks (curve's place in the order of starting, sample, node) one after another."""
    order: list[int] = []
    marks: list[tuple[int, int, int]] = []
    for message in messages:
        if isinstance(message, CurveStart):
            order.append(message.curve)
        elif isinstance(message, NodeMark):
            mark = (order.index(message.curve), message.sample, message.node)
            if message.undo:
                marks.remove(mark)
            else:
                marks.append(mark)
    return sorted(marks)


def test_a_group_is_stored_whole_or_not_at_all(database: Database) -> None:
    """The last row of a group contradicts the database: nothing of its other recordings is there either."""
    with database.write() as transaction:
        good = open_recording(transaction, HELLO, HELLO.model_dump_json().encode())
    group = Group()
    for message in [CurveStart(seq=0, curve=0), CurveEnd(seq=1, curve=0)]:
        good.advance(message, 1)
        group.add(good, message, b"x")
    group.messages.append({"recording_key": good.key + 1000, "seq": 0, "payload": b"y"})
    with pytest.raises(Exception, match=r"(?i)foreign key"), database.write() as transaction:
        commit(transaction, group)
    with database.read() as transaction:
        assert transaction.scalars(select(MessageRow)).all() == []
        assert transaction.scalar(select(RecordingRow.next_seq)) == 0


def test_a_hundred_recordings_take_no_statement_for_each(database: Database) -> None:
    """Neither a round trip nor the interpreter's lock is asked for row by row."""
    hellos = [HELLO.model_copy(update={"recording": f"r{number}"}) for number in range(109)]
    with database.write() as transaction:
        states = [open_recording(transaction, hello, hello.model_dump_json().encode()) for hello in hellos]
    row_by_row: list[bool] = []
    event.listen(database.engine, "before_cursor_execute", lambda *about: row_by_row.append(about[-1]))
    for group in _start_and_sample(states):
        row_by_row.clear()
        with database.write() as transaction:
            commit(transaction, group)
    assert not any(row_by_row) and len(row_by_row) < len(states) / 2
    with database.read() as transaction:
        assert all(len(list(recording_messages(transaction, state.key))) == 2 for state in states)
        reached = dict(transaction.execute(select(RecordingRow.key, RecordingRow.bytes)).all())
        lengths = [list_curves(transaction, state.session.id)[0].length for state in states]
    assert reached == {state.key: state.bytes for state in states}
    assert lengths == [state.curves[0].length for state in states] == [number / 7 for number in range(109)]


def _start_and_sample(states: list[RecordingState]) -> Iterator[Group]:
    """A group that starts a curve of each, and one that goes as far along each as nobody else."""
    started, sampled = Group(), Group()
    for number, state in enumerate(states):
        distance = [0.0, number / 7]
        samples = Samples(seq=1, curve=0, first_sample=0, distance=distance, quaternion=[(1.0, 0.0, 0.0, 0.0)] * 2)
        for group, message in ((started, CurveStart(seq=0, curve=0)), (sampled, samples)):
            state.advance(message, 1 + number)
            group.add(state, message, b"x")
    yield from (started, sampled)


def test_pages_of_messages_are_all_messages(database: Database) -> None:
    messages: list[Recorded] = [CurveStart(seq=0, curve=0)]
    messages += [Samples(seq=i, curve=0, first_sample=i - 1, distance=[0.0], **FLAT) for i in range(1, 450)]
    state = store(database, HELLO, messages, [], restart=False)
    with database.read() as transaction:
        row = recording_row(transaction, state.session.id, "r")
        stored = list(recording_messages(transaction, row.key))
        assert stored == [m.model_dump_json(exclude_none=True).encode() for m in messages]
        assert list(recording_messages(transaction, row.key, first=400)) == stored[400:]


def test_the_same_recording_may_be_in_two_sessions(database: Database) -> None:
    """A file is a copy; the device goes on with its own."""
    with database.write() as transaction:
        own = open_recording(transaction, HELLO, HELLO.model_dump_json().encode())
        other = open_recording(
            transaction, HELLO.model_copy(update={"recording": "s"}), HELLO.model_dump_json().encode()
        )
        copy = HELLO.model_copy(update={"session": other.session.id})
        copied = open_recording(transaction, copy, HELLO.model_dump_json().encode())
        assert copied.key != own.key
        assert open_recording(transaction, HELLO, b"").key == own.key
        assert open_recording(transaction, copy, b"").key == copied.key


def test_versions_must_meet(database: Database) -> None:
    with pytest.raises(Refused, match="version"), database.write() as transaction:
        open_recording(transaction, HELLO.model_copy(update={"versions": [7]}), b"")


def opened(transaction: Session, hello: Hello, owner: str) -> RecordingState:
    """A recording that a server has now."""
    return open_recording(transaction, hello, hello.model_dump_json().encode(), owner)


def started(state: RecordingState) -> Group:
    """A group in which each recording starts a curve."""
    group = Group()
    message = CurveStart(seq=state.next_seq, curve=len(state.curves))
    state.advance(message, 1)
    group.add(state, message, b"x")
    return group


def test_what_another_server_goes_on_with_is_left_out_and_the_rest_is_stored(database: Database) -> None:
    with database.write() as transaction:
        moved = opened(transaction, HELLO, "first")
        stays = opened(transaction, HELLO.model_copy(update={"recording": "s"}), "first")
    with database.write() as transaction:
        again = opened(transaction, HELLO, "second")
        assert (again.taken_over, moved.taken_over) == (True, False)
    group = started(moved)
    for rows, others in zip(vars(group).values(), vars(started(stays)).values(), strict=True):
        rows.extend(others) if isinstance(rows, list) else rows.update(others)
    with pytest.raises(Overtaken) as overtaken, database.write() as transaction:
        commit(transaction, group, "first")
    assert {key: reason.code for key, reason in overtaken.value.reasons.items()} == {moved.key: "limit"}
    group.drop(moved.key)
    with database.write() as transaction:
        commit(transaction, group, "first")
        commit(transaction, started(again), "second")
    with database.read() as transaction:
        assert transaction.scalars(select(MessageRow.recording_key).order_by(MessageRow.recording_key)).all() == [
            moved.key, stays.key,
        ]  # fmt: skip


def test_two_servers_never_give_two_curves_one_index(database: Database) -> None:
    with database.write() as transaction:
        one = opened(transaction, HELLO, "first")
        hello = HELLO.model_copy(update={"recording": "s", "session": one.session.id})
        two = opened(transaction, hello, "second")
    with database.write() as transaction:
        commit(transaction, started(one), "first")
    with pytest.raises(Overtaken) as overtaken, database.write() as transaction:
        commit(transaction, started(two), "second")
    assert [(key, reason.code) for key, reason in overtaken.value.reasons.items()] == [(two.key, "storage")]
    with database.write() as transaction:
        two = opened(transaction, hello, "second")
        commit(transaction, started(two), "second")
    with database.read() as transaction:
        assert [c.index for c in list_curves(transaction, one.session.id)] == [0, 1]


def test_a_deleted_recording_is_told_to_whoever_still_sends_it(database: Database) -> None:
    with database.write() as transaction:
        state = opened(transaction, HELLO, "first")
        delete_session(transaction, state.session.id)
    with pytest.raises(Overtaken) as overtaken, database.write() as transaction:
        commit(transaction, started(state), "first")
    assert overtaken.value.reasons[state.key].code == "unknown"


def test_servers_count_the_readings_of_one_session_together(database: Database) -> None:
    """Each goes on from what is stored, not from what it counted itself."""
    ribbon = SensorArray(curves=[ArrayCurve(sensors=[0, 1], spacing=[0.1])])
    session, states = new_id(), {}
    with database.write() as transaction:
        transaction.add(SessionRow(id=session, name=""))
    for owner in ("here", "there"):
        hello = Hello(recording=owner, session=session, device=Device(id="d", kind="k", array=ribbon))
        with database.write() as transaction:
            states[owner] = open_recording(transaction, hello, hello.model_dump_json().encode(), owner)
    for time in range(6):
        owner = "here" if time % 2 else "there"
        group, state = Group(), states[owner]
        reading = ArrayReading(seq=state.next_seq, time=time, quaternion=[(1.0, 0.0, 0.0, 0.0)] * 2)
        state.advance(reading, 2)
        group.add(state, reading, b"{}")
        with database.write() as transaction:
            commit(transaction, group, owner)
    with database.read() as transaction:
        assert list_readings(transaction, session, 0, 10).times == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_device_that_nobody_knew_comes_to_two_servers_at_once(database: Database) -> None:
    def begin() -> None:
        with database.write() as transaction:
            open_recording(transaction, HELLO, HELLO.model_dump_json().encode())

    other = Thread(target=begin)
    with database.write() as transaction:
        seen(transaction, HELLO.device)
        other.start()
        other.join(0.5)  # enough for it where nothing holds it up
    other.join()
    with database.read() as transaction:
        assert transaction.scalars(select(RecordingRow)).one().id == "r"
        assert [device.id for device in list_devices(transaction)] == ["d"]


def test_a_mark_of_the_device_and_an_edit_of_the_page_are_both_kept(database: Database) -> None:
    """Whoever edits marks has seen all that there are: a device's next one waits until the edit is stored."""
    ride: list[Recorded] = [
        CurveStart(seq=0, curve=0),
        Samples(seq=1, curve=0, first_sample=0, **{name: 3 * column for name, column in FLAT.items()}),
    ]
    state = store(database, HELLO, ride, [2], restart=False)
    mark, group = NodeMark(seq=2, curve=0, sample=2, node=7), Group()
    state.advance(mark, 2)
    group.add(state, mark, b"{}")

    def record() -> None:
        with database.write() as transaction:
            commit(transaction, group)

    device = Thread(target=record)
    with database.write() as transaction:
        lock_session(transaction, state.session.id)
        assert get_curve(transaction, state.session.id, 0).marks == []
        device.start()
        device.join(0.5)  # enough for it where nothing holds it up
        update_curve(transaction, state.session.id, 0, CurveUpdate(marks=[Mark(sample=0, node=1)]))
    device.join()
    with database.read() as transaction:
        kept = get_curve(transaction, state.session.id, 0).marks
    assert [(mark.sample, mark.node) for mark in kept] == [(0, 1), (2, 7)]
