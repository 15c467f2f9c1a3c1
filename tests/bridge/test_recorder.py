from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.wire.device import CurveEnd, CurveStart, Device, Hello, NodeMark, Samples, from_device
from tracemesh_bridge.errors import OperatorMistake
from tracemesh_bridge.recorder import BATCH, Recorder
from tracemesh_bridge.source import Reading
from tracemesh_bridge.spool import Spool

HELLO = Hello(recording="r", device=Device(id="d", kind="k"))


def reading(number, **more):
    return Reading(received=float(number), ticks=(0, number % 500), quaternion=(1.0, 0.0, 0.0, 0.0), **more)


def messages(spool):
    spool.sync()
    cursor = spool.lines(0)
    return [from_device.validate_json(line) for line in iter(cursor.next, None)]


class Session:
    """A recorder, and what it must have recorded."""

    def __init__(self, folder):
        self.folder = folder
        self.expected = []
        self.is_open = False
        self.crash()

    def crash(self):
        self.spool = Spool(self.folder, HELLO)
        self.recorder = Recorder(self.spool)

    def sample(self, number):
        self.recorder.add(reading(number))
        if self.is_open:
            self.expected[-1].append(float(number))

    def start(self):
        self.recorder.start(boundary=True)
        self.expected.append([])
        self.is_open = True

    def end(self, discard):
        _ = self.recorder.discard() if discard else self.recorder.end(closed=True)
        self.is_open = False


STEPS = {
    "sample": lambda session, number: session.sample(number),
    "start": lambda session, _: session.start(),
    "end": lambda session, number: session.end(discard=number % 2 == 0),
    "mark": lambda session, number: session.recorder.mark(number),
    "undo": lambda session, _: session.recorder.undo(),
    "flush": lambda session, _: session.recorder.flush(),
    "crash": lambda session, _: session.crash(),
}


@settings(max_examples=150, deadline=None)
@given(st.lists(st.sampled_from([*STEPS, "sample", "sample", "sample", "start"]), min_size=10, max_size=60))
def test_whatever_is_pressed_and_whenever_it_is_killed_every_sample_of_a_curve_is_recorded_once(
    tmp_path_factory, steps
):
    session = Session(tmp_path_factory.mktemp("spool"))
    for number, step in enumerate(steps):
        try:
            STEPS[step](session, number)
        except OperatorMistake:
            assert step in ("start", "end", "mark", "undo")
        assert session.recorder.progress.open == session.is_open
    session.recorder.flush()
    recorded = messages(session.spool)
    assert [m.seq for m in recorded] == list(range(len(recorded)))
    times = [[] for _ in session.expected]
    for m in recorded:
        if isinstance(m, Samples):
            assert m.first_sample == len(times[m.curve])
            times[m.curve].extend(m.received)
        if isinstance(m, NodeMark):
            assert m.sample < len(times[m.curve])
    assert times == session.expected
    assert [m.curve for m in recorded if isinstance(m, CurveStart)] == list(range(len(times)))
    assert all(a.curve + 1 == b.curve for a, b in pairwise(m for m in recorded if isinstance(m, CurveEnd)))
    session.spool.close()


@pytest.fixture
def spool(tmp_path):
    spool = Spool(tmp_path, HELLO)
    yield spool
    spool.close()


def test_a_mark_is_at_the_newest_sample(spool):
    recorder = Recorder(spool)
    recorder.start(boundary=False)
    recorder.mark(5)
    for number in range(23):
        recorder.add(reading(number))
    recorder.mark(6)
    assert [(m.sample, m.node) for m in messages(spool) if isinstance(m, NodeMark)] == [(0, 5), (22, 6)]


def test_a_killed_bridge_goes_on_with_the_samples_that_were_in_no_message_yet(spool, tmp_path):
    recorder = Recorder(spool)
    recorder.start(boundary=False)
    for number in range(BATCH + 3):
        recorder.add(reading(number))
    spool = Spool(tmp_path, HELLO)
    recorder = Recorder(spool)
    recorder.add(reading(BATCH + 3))
    recorder.flush()
    times = [t for m in messages(spool) if isinstance(m, Samples) for t in m.received]
    assert times == [float(n) for n in range(BATCH + 4)]
    spool.close()


def test_marks_are_taken_back_newest_first_after_a_restart_too(spool, tmp_path):
    recorder = Recorder(spool)
    recorder.start(boundary=False)
    for node in (1, 2, 3):
        recorder.add(reading(node))
        recorder.mark(node)
    recorder.undo()
    recorder.flush()
    spool.sync()
    again = Spool(tmp_path, HELLO)
    recorder = Recorder(again)
    recorder.undo()
    recorder.undo()
    with pytest.raises(OperatorMistake, match="no mark to take back"):
        recorder.undo()
    undone = [(m.sample, m.node) for m in messages(again) if isinstance(m, NodeMark) and m.undo]
    assert undone == [(2, 3), (1, 2), (0, 1)]
    again.close()


def test_a_mark_before_the_first_sample_can_be_taken_back(spool):
    recorder = Recorder(spool)
    recorder.start(boundary=False)
    recorder.mark(1)
    recorder.undo()
    recorder.add(reading(0))
    recorder.flush()
    assert not [m for m in messages(spool) if isinstance(m, NodeMark)]


def test_a_thrown_away_curve_is_kept_as_sent_and_marked(spool):
    recorder = Recorder(spool)
    recorder.start(boundary=False)
    recorder.add(reading(0))
    recorder.discard()
    start, samples, end = messages(spool)
    assert (start.curve, samples.count, end.discard) == (0, 1, True)


def test_keys_that_make_no_sense_say_which_would(spool):
    recorder = Recorder(spool)
    for act in (lambda: recorder.end(closed=False), lambda: recorder.mark(1), recorder.undo, recorder.discard):
        with pytest.raises(OperatorMistake, match="no curve is open: start one with -"):
            act()
    recorder.start(boundary=True)
    with pytest.raises(OperatorMistake, match="curve 0 is still open"):
        recorder.start(boundary=True)


def test_samples_with_other_columns_begin_another_message(spool):
    recorder = Recorder(spool)
    recorder.start(boundary=True)
    recorder.add(reading(0))
    recorder.add(reading(1, rotation_rate=(0.0, 0.0, 1.0)))
    for number in range(2, 2 + BATCH):
        recorder.add(reading(number))
    blocks = [m for m in messages(spool) if isinstance(m, Samples)]
    assert [m.count for m in blocks] == [1, 1, BATCH]
    assert [m.rotation_rate is None for m in blocks] == [True, False, True]
