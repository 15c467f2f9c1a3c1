"""The whole bridge against a real pseudo-terminal and a real WebSocket: whatever dies, every sample arrives once."""

import os
import resource
import signal
import subprocess
import sys
import termios
import threading
import time

import pytest

from tracemesh.geometry.simulated.shapes import cone
from tracemesh.wire.device import CurveEnd, CurveStart, ErrorMessage, NodeMark


def is_slice(part, whole):
    """Whether `part` is a run of `whole` without anything left out."""
    start = whole.index(part[0])
    return whole[start : start + len(part)] == part


def missing(part, whole):
    """How many frames of the run of `whole` that `part` covers are not in it; fails if they are in another order."""
    places = [whole.index(frame) for frame in part]
    assert places == sorted(set(places))
    return places[-1] - places[0] + 1 - len(places)


def record_a_curve(bench, bridge, samples=80):
    bridge.says("device: live")
    bridge.type("-")
    bench.samples(samples)


def test_what_the_device_sent_is_stored(bench):
    bench.virtual()
    bridge = bench.bridge("--session", "bowl", "--circumference", "0.2")
    record_a_curve(bench, bridge)
    bridge.type("3\n")
    bench.samples(40)
    bridge.type("14\n*+")
    bench.samples(30)
    bridge.type(".q")
    assert bridge.wait() == 0
    assert is_slice(bench.server.frames(0), bench.sent())
    assert is_slice(bench.server.frames(1), bench.sent())
    marks = [m for m in bench.server.messages if isinstance(m, NodeMark)]
    assert [m.node for m in marks] == [3, 14]
    assert 0 < marks[0].sample < marks[1].sample == len(bench.server.frames(0)) - 1
    assert [m.boundary for m in bench.server.messages if isinstance(m, CurveStart)] == [True, False]
    assert [m.closed for m in bench.server.messages if isinstance(m, CurveEnd)] == [True, False]
    (hello,) = bench.server.hellos
    assert (hello.session, hello.device.kind, hello.device.wheel.circumference) == ("bowl", "morphorider", 0.2)
    assert bench.server.headers[0]["Authorization"] == "Bearer secret"
    assert not list((bench.folder / "spool").glob("*/*")), "all is acknowledged: nothing may stay"


def test_the_virtual_operator_scans_a_whole_shape(bench):
    device = bench.virtual("--shape", "cone", "--speed", "6")
    bridge = bench.bridge("--rate", "200")
    typed = 0
    while "quitting" not in bridge.said:
        typed += bridge.type(device.keys[typed:].decode())
        time.sleep(0.005)
    assert bridge.wait() == 0
    assert device.wait() == 0
    marks = [(m.curve, m.node) for m in bench.server.messages if isinstance(m, NodeMark)]
    expected = [(c, int(n)) for c, curve in enumerate(cone().curves) for n in curve.node_ids]
    assert marks == expected
    assert all(is_slice(bench.server.frames(c), bench.sent()) for c in range(len(cone().curves)))


def test_a_few_samples_do_not_wait_for_more(bench, eventually):
    device = bench.virtual()
    bridge = bench.bridge("--rate", "20")
    record_a_curve(bench, bridge, 4)
    device.stop(signal.SIGTERM)
    bridge.says("device: lost")
    # the answer on its way at the end is lost with the line
    eventually(lambda: bench.server.stored and set(bench.server.frames(0)[-1:]) & set(bench.sent()[-2:]))


@pytest.mark.parametrize("server_is_there", [True, False])
def test_killed_in_mid_curve_it_goes_on_with_the_curve(bench, server_is_there):
    bench.server.silent = not server_is_there
    bench.virtual()
    for _ in range(3):
        bridge = bench.bridge()
        bridge.says("device: live")
        if "going on with curve 0" not in bridge.said:
            bridge.type("+1\n")
        bench.samples(57)
        bridge.stop(signal.SIGKILL)
    bench.server.silent = False
    bridge = bench.bridge()
    bridge.says("device: live")
    bench.samples(20)
    bridge.type("2\n.q")
    assert bridge.wait() == 0
    assert missing(bench.server.frames(0), bench.sent()) <= 3, "only the answer on its way at each of three kills"
    assert [m.node for m in bench.server.messages if isinstance(m, NodeMark)] == [1, 2]
    assert len(bench.server.stored) == 1, "one recording"


def test_what_the_network_lost_is_sent_again(bench):
    bench.server.drop_after, bench.server.lose = 5, 7
    bench.virtual()
    bridge = bench.bridge()
    record_a_curve(bench, bridge, 200)
    bridge.type(".q")
    assert bridge.wait() == 0
    assert is_slice(bench.server.frames(0), bench.sent())
    assert len(bench.server.hellos) == 3
    assert bridge.said.count("server: lost") == 2


def test_without_a_server_it_records_and_sends_later(bench, make_server):
    bench.virtual()
    address, bench.server.port = bench.server.port, 1
    bridge = bench.bridge()
    record_a_curve(bench, bridge)
    bridge.type(".q")
    bridge.says("sending the rest")
    assert bridge.stop(signal.SIGTERM) == 1
    assert "messages wait in" in bridge.said
    bench.server.port = address
    bridge = bench.bridge()
    bridge.says("server: live")
    bridge.type("q")
    assert bridge.wait() == 0
    assert is_slice(bench.server.frames(0), bench.sent())


def test_quitting_does_not_wait_for_a_server_that_does_not_want_the_recording(bench):
    bench.server.refusal = ErrorMessage(code="unknown", message="there is no session nowhere")
    bench.virtual()
    bridge = bench.bridge("--session", "nowhere")
    record_a_curve(bench, bridge, 30)
    bridge.type(".q")
    assert bridge.wait() == 1
    assert "tracemesh-bridge: the server says unknown: there is no session nowhere" in bridge.said
    bench.server.refusal = None
    bridge = bench.bridge("--session", "nowhere")
    bridge.says("server: live")
    bridge.type("q")
    assert bridge.wait() == 0
    assert is_slice(bench.server.frames(0), bench.sent())


def test_another_session_gets_a_recording_of_its_own_and_the_old_one_is_sent_too(bench, eventually):
    bench.server.refusal = ErrorMessage(code="forbidden", message="this token may not record")
    bench.virtual()
    bridge = bench.bridge("--session", "first")
    bridge.says("the server says forbidden: this token may not record")
    record_a_curve(bench, bridge, 30)
    bridge.type(".")
    bridge.says("ended")
    bridge.stop(signal.SIGINT)
    bench.server.refusal = None
    bridge = bench.bridge("--session", "second")
    eventually(lambda: len(list((bench.folder / "spool").glob("*/"))) == 1)
    bridge.type("q")
    assert bridge.wait() == 0
    first, second = (next(h for h in bench.server.hellos if h.session == s) for s in ("first", "second"))
    assert [type(m) for m in bench.server.stored[first.recording]][-1] is CurveEnd
    assert bench.server.stored[second.recording] == []


def test_a_full_disk_is_said_and_costs_nothing_once_there_is_room(bench):
    bench.virtual()
    bridge = bench.bridge()
    record_a_curve(bench, bridge, 50)
    _, hard = resource.prlimit(bridge.pid, resource.RLIMIT_FSIZE)
    (segment,) = (bench.folder / "spool").glob("*/0*.ndjson")
    resource.prlimit(bridge.pid, resource.RLIMIT_FSIZE, (segment.stat().st_size + 3001, hard))  # in mid-message
    bridge.says("cannot write the spool")
    bench.samples(100)
    resource.prlimit(bridge.pid, resource.RLIMIT_FSIZE, (hard, hard))
    bridge.says("spool: writes again")
    bench.samples(20)
    bridge.type(".q")
    assert bridge.wait() == 0
    assert is_slice(bench.server.frames(0), bench.sent())


def test_unplugged_it_is_found_at_another_port(bench):
    bench.virtual("--unplug", "120")
    bridge = bench.bridge()
    record_a_curve(bench, bridge, 60)
    bridge.says("device: lost")
    bridge.says("rider.1")
    bench.samples(30)
    bridge.type(".q")
    assert bridge.wait() == 0
    assert missing(bench.server.frames(0), bench.sent()) <= 1
    assert bridge.said.count("device: lost") == 1


def test_two_bridges_cannot_share_a_spool(bench):
    bench.virtual()
    bridge = bench.bridge()
    bridge.says("device: live")
    other = bench.bridge()
    assert other.wait() == 1
    assert "another bridge uses" in other.said


def test_a_source_that_cannot_work_ends_the_bridge_with_its_words(bench):
    bridge = bench.recording("sensorserver", "--address", "127.0.0.1:1", "--sensors", "gyroscope")
    assert bridge.wait() == 1
    assert "wanted one of rotation_vector" in bridge.said


def test_what_could_not_be_written_before_the_end_is_told(bench):
    bench.virtual()
    bridge = bench.bridge()
    record_a_curve(bench, bridge, 50)
    resource.prlimit(bridge.pid, resource.RLIMIT_FSIZE, (3000, resource.RLIM_INFINITY))
    bridge.says("cannot write the spool")
    bench.samples(60)
    assert bridge.stop(signal.SIGTERM) == 1
    assert "messages were lost: cannot write the spool: File too large" in bridge.said
    bridge = bench.bridge()
    bridge.says("going on with curve 0")
    bench.samples(20)
    bridge.type(".q")
    assert bridge.wait() == 0
    assert missing(bench.server.frames(0), bench.sent()) > 0, "and only what was told is missing, in order"


def test_keys_from_a_terminal_need_no_enter_and_the_terminal_is_as_before(bench, eventually):
    bench.virtual()
    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    arguments = ["--port", str(bench.folder / "rider"), "--spool", str(bench.folder / "spool")]
    bridge = subprocess.Popen(
        [sys.executable, "-m", "tracemesh_bridge", "morphorider", *arguments, "--server", bench.server.address],
        stdin=slave, stderr=slave, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    shown = bytearray()
    reader = threading.Thread(target=lambda: [shown.extend(os.read(master, 1000)) for _ in iter(bridge.poll, 0)])
    reader.start()
    for key, words in ((b"", b"device: live"), (b"+", b"curve 0 (interior) started"), (b"12\r", b"node 12 at")):
        os.write(master, key)
        eventually(lambda words=words: words in shown)
    eventually(lambda: b"Hz  jitter" in shown)
    eventually(lambda: b"nodes 12" in shown)
    os.write(master, b".q")
    assert bridge.wait(30) == 0
    os.write(slave, b"\n")
    reader.join()
    assert termios.tcgetattr(slave) == before
    for end in (master, slave):
        os.close(end)
    assert len(bench.server.frames(0)) > 0


def test_a_left_over_recording_is_sent_with_the_samples_that_were_in_no_message_yet(bench, eventually):
    bench.server.silent = True
    device = bench.virtual("--noise", "0.5")
    bridge = bench.bridge("--rate", "20")
    record_a_curve(bench, bridge, 25)
    bridge.stop(signal.SIGKILL)
    device.stop(signal.SIGTERM)
    sent = bench.sent()
    bench.server.silent = False
    (old,) = (bench.folder / "spool").glob("*/")
    bridge = bench.bridge("--session", "another")
    eventually(lambda: not old.exists())
    bridge.type("q")
    assert bridge.wait() == 0
    bench.server.stored = {old.name: bench.server.stored[old.name]}
    assert missing(bench.server.frames(0), sent) == 0
    assert sent.index(bench.server.frames(0)[-1]) >= len(sent) - 2, "the last one may have been on its way"
