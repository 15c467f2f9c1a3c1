"""Laws of the spool: what was durable survives any crash, what was not may be torn, nothing changes or is doubled."""

import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.wire.device import CurveEnd, CurveStart, Device, Hello, NodeMark, Samples, from_device
from tracemesh_bridge.errors import SpoolError
from tracemesh_bridge.spool import MAX_WAITING, Spool, exclusive, open_spools

HELLO = Hello(recording="r", device=Device(id="d", kind="k"))


def message(seq, kind=1):
    """Any message; the spool does not care about its curve."""
    if kind == 0:
        return CurveStart(seq=seq, curve=seq)
    if kind == 1:
        return Samples(seq=seq, curve=0, first_sample=seq, received=[0.1], quaternion=[(1, 0, 0, 0)])
    return NodeMark(seq=seq, curve=0, sample=seq, node=7) if kind == 2 else CurveEnd(seq=seq, curve=seq)


def read(spool, seq):
    cursor = spool.lines(seq)
    return [from_device.validate_json(line) for line in iter(cursor.next, None)]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(["append", "sync", "ack", "crash", "read"]), st.integers(0, 3)), max_size=40))
def test_it_keeps_every_message_until_it_is_acknowledged(steps):
    with tempfile.TemporaryDirectory() as folder:
        spool = Spool(Path(folder) / "r", HELLO, segment_bytes=300)
        kept, acknowledged = [], -1
        for step, number in steps:
            if step == "append":
                kept.append(message(spool.next_seq, number))
                spool.append(kept[-1])
            elif step == "sync":
                spool.sync()
            elif step == "ack":
                acknowledged = max(acknowledged, spool.durable - 1 - number)
                spool.acknowledge(acknowledged)
            elif step == "crash":  # kill -9: what was written is there, durable or not
                spool = Spool(Path(folder) / "r", HELLO, segment_bytes=300)
                assert spool.durable == spool.next_seq == len(kept)
            else:
                assert read(spool, acknowledged + 1) == kept[acknowledged + 1 : spool.durable]
        assert spool.first_seq <= acknowledged + 1
        spool.close()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 3), min_size=1, max_size=12), st.floats(0, 1), st.binary(max_size=30))
def test_a_torn_end_costs_only_what_was_torn(kinds, where, garbage):
    with tempfile.TemporaryDirectory() as folder:
        spool = Spool(Path(folder) / "r", HELLO)
        messages = [message(seq, kind) for seq, kind in enumerate(kinds)]
        for m in messages:
            spool.append(m)
        spool.close()
        (file,) = (p for p in (Path(folder) / "r").glob("0*.ndjson"))
        whole = file.read_bytes()
        size = round(where * len(whole))
        file.write_bytes(whole[:size] + garbage.replace(b"\n", b""))
        lines = whole[:size].count(b"\n")
        assert read(Spool(Path(folder) / "r", HELLO), 0) == messages[: max(lines - 1, 0)]


def test_a_cursor_follows_the_spool_as_it_grows(tmp_path):
    spool = Spool(tmp_path, HELLO, segment_bytes=400)
    cursor, seen = spool.lines(0), []
    for seq in range(30):
        spool.append(message(seq))
        assert cursor.next() is None, "not durable yet"
        spool.sync()
        seen.append(from_device.validate_json(cursor.next()))
        spool.acknowledge(seq - 3)
    assert seen == [message(seq) for seq in range(30)]
    assert spool.first_seq > 0
    with pytest.raises(SpoolError, match="message 0 was deleted"):
        spool.lines(0)
    spool.close()


def test_a_segment_begins_where_a_restart_can_go_on(tmp_path):
    spool = Spool(tmp_path, HELLO, segment_bytes=1)
    for seq, kind in enumerate([0, 1, 2, 2, 3, 0, 2, 1]):
        spool.append(message(seq, kind))
    spool.close()
    assert sorted(p.stem for p in tmp_path.glob("0*.ndjson")) == [f"{n:012d}" for n in (0, 1, 5, 7)]
    recording = sorted(tmp_path.glob("0*.ndjson"))[-1].read_text().splitlines()
    assert from_device.validate_json(recording[0]) == HELLO


def test_what_the_disk_does_not_make_durable_may_not_be_sent(tmp_path, monkeypatch):
    spool = Spool(tmp_path, HELLO)
    spool.append(message(0))

    def fail(_):
        raise OSError("the disk is gone")

    with monkeypatch.context() as broken:
        broken.setattr(os, "fsync", fail)
        with pytest.raises(OSError, match="the disk is gone"):
            spool.sync()
    assert read(spool, 0) == []
    spool.sync()
    assert read(spool, 0) == [message(0)]
    spool.close()


def test_something_else_among_the_messages_is_not_guessed_at(tmp_path):
    spool = Spool(tmp_path, HELLO)
    for seq in range(3):
        spool.append(message(seq))
    spool.close()
    (file,) = tmp_path.glob("0*.ndjson")
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:2], "what?", *lines[3:]]) + "\n")
    with pytest.raises(SpoolError, match="line 3: wanted message 1"):
        Spool(tmp_path, HELLO)


def test_messages_come_in_order(tmp_path):
    spool = Spool(tmp_path, HELLO)
    with pytest.raises(SpoolError, match="wanted message 0, got 1"):
        spool.append(message(1))
    spool.close()


def test_staged_samples_outlive_a_crash_and_end_with_the_message(tmp_path):
    spool = Spool(tmp_path, HELLO)
    staged = [message(0), message(0)]
    for samples in staged:
        spool.stage(samples)
    with (tmp_path / "staged.ndjson").open("ab") as file:
        file.write(b'{"type":"samp')
    assert list(Spool(tmp_path, HELLO).staged()) == staged
    spool.append(message(0))
    assert list(spool.staged()) == []
    spool.close()


def test_when_the_disk_is_full_messages_wait_up_to_a_bound(tmp_path, monkeypatch):
    spool = Spool(tmp_path, HELLO)
    spool.append(message(0))
    full = os.open("/dev/full", os.O_WRONLY | os.O_APPEND)
    disk, spool._file = spool._file, full  # the kernel itself says that there is no space left
    monkeypatch.setattr(os, "ftruncate", lambda *_: None)  # which a device file does not take
    for seq in range(1, MAX_WAITING + 1):
        spool.append(message(seq))
    assert "No space left on device" in spool.trouble
    with pytest.raises(SpoolError, match="no more can"):
        spool.append(message(MAX_WAITING + 1))
    assert spool.written == 1
    spool._file = disk
    spool.sync()
    assert spool.trouble == ""
    assert read(spool, 0) == [message(seq) for seq in range(MAX_WAITING + 1)]
    os.close(full)
    spool.close()


def test_a_recording_is_continued_only_by_the_same_device_for_the_same_session(tmp_path):
    def opened(hello):
        spool, left_over = open_spools(tmp_path, hello)
        if spool.next_seq == 0:
            spool.append(message(0))
        for s in (spool, *left_over):
            s.close()
        return spool.hello.recording, sorted(s.hello.recording for s in left_over)

    named = [HELLO.model_copy(update={"recording": name}) for name in "abcd"]
    assert opened(named[0]) == ("a", [])
    assert opened(named[1]) == ("a", [])
    assert opened(named[2].model_copy(update={"session": "s"})) == ("c", ["a"])
    turned = Device(id="d", kind="k", mounting=(0, 1, 0, 0))
    assert opened(named[3].model_copy(update={"device": turned})) == ("d", ["a", "c"])
    (tmp_path / "empty").mkdir()
    assert opened(named[1]) == ("a", ["c", "d"])
    shutil.copy(tmp_path / "a" / "staged.ndjson", tmp_path / "empty" / "000000000000.ndjson")
    assert opened(named[1]) == ("a", ["c", "d"])


def test_one_bridge_per_spool(tmp_path):
    with exclusive(tmp_path), pytest.raises(SpoolError, match="another bridge uses"), exclusive(tmp_path):
        pass
    with exclusive(tmp_path):
        pass
