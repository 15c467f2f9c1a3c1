"""A fixed array behind a program, as processes: every whole reading is stored once and in order, whatever dies."""

import json
import signal
import sys
from pathlib import Path

import pytest

from tracemesh.wire.arrays import ArrayReading
from tracemesh_bridge.cli import main

READING = {"quaternion": [[1.0, 0.0, 0.0, 0.0]] * 8}
PRINT = """
import json, os, time
parent = os.getppid()
for n in range({first}, {last}):
    print(json.dumps({{"time": n, **{reading}}}), flush=True)
"""
WAIT = "while os.getppid() == parent:\n    time.sleep(0.02)\n"  # as long as the bridge lives


@pytest.fixture
def topology(tmp_path, capsys):
    assert main(["virtual-array", "ribbon", "--declare"]) == 0
    path = tmp_path / "ribbon.json"
    path.write_text(capsys.readouterr().out)
    return str(path)


def printing(first, last, then="", reading=READING):
    """A program that prints these readings, and then does something else."""
    return (sys.executable, "-c", PRINT.format(first=first, last=last, reading=reading) + then)


def times(messages):
    assert all(isinstance(m, ArrayReading) for m in messages)
    assert [m.seq for m in messages] == [*range(len(messages))]
    return [m.time for m in messages]


def array(bench, topology, *program):
    return bench.recording("array", "--topology", topology, "--session", "sheet", "--", *program)


def test_the_virtual_ribbon_is_recorded(bench, topology):
    bridge = array(bench, topology, sys.executable, "-m", "tracemesh_bridge", "virtual-array", "ribbon",
                   "--rate", "300", "--readings", "90")  # fmt: skip
    assert bridge.wait() == 0, bridge.said
    assert times(bench.server.messages) == pytest.approx([n / 300 for n in range(90)])
    (hello,) = bench.server.hellos
    assert (hello.session, hello.device.kind, hello.device.array.sensor_count) == ("sheet", "array", 8)
    assert "device: live: 8 sensors" in bridge.said
    assert not list((bench.folder / "spool").glob("*/*")), "all is acknowledged: nothing may stay"


def test_what_the_network_lost_is_sent_again(bench, topology):
    bench.server.drop_after, bench.server.lose = 5, 7
    assert array(bench, topology, *printing(0, 200)).wait() == 0
    assert times(bench.server.messages) == [*range(200)]


@pytest.mark.parametrize("server_is_there", [True, False])
def test_killed_it_goes_on_with_the_recording(bench, topology, eventually, server_is_there):
    """Each start reads a program that has printed its part and waits: all that the bridge has read is stored."""
    bench.server.silent = not server_is_there
    for start in (0, 50):
        bridge = array(bench, topology, *printing(start, start + 50, WAIT))
        bridge.says("device: live")
        eventually(lambda wanted=start + 50: spooled(bench) == wanted)
        bridge.stop(signal.SIGKILL)
    bench.server.silent = False
    bridge = array(bench, topology, *printing(100, 120))
    assert bridge.wait() == 0, bridge.said
    assert "from reading 100 on" in bridge.said
    assert times(bench.server.messages) == [*range(120)]
    assert len(bench.server.stored) == 1, "one recording"


def spooled(bench):
    """Whole readings on the bridge's disk, those acknowledged and deleted not counted: there are few of them here."""
    lines = [line for p in (bench.folder / "spool").glob("*/0*.ndjson") for line in p.read_bytes().splitlines(True)]
    return sum(line.endswith(b"\n") and b'"reading"' in line for line in lines)


def test_lines_that_are_no_readings_are_said_and_left_out(bench, topology):
    bad = "print('no json'); print([1]); print(json.dumps({'time': 9}))\n"
    short = "print(json.dumps({'time': 9, 'quaternion': [[1, 0, 0, 0]]}))\n"
    bridge = array(bench, topology, *printing(0, 5, bad + short))
    assert bridge.wait() == 0
    assert times(bench.server.messages) == [*range(5)]
    assert "wanted a JSON object" in bridge.said
    assert "wanted 8 sensors, as the hello's array has, got 1" in bridge.said


def test_keys_of_curves_mean_nothing_and_q_quits(bench, topology):
    bridge = array(bench, topology, *printing(0, 5, WAIT))
    bridge.says("device: live")
    bridge.type("+")
    bridge.says("an array has its curves already, and every reading is recorded: q quits")
    bridge.type("3\n.q")
    assert bridge.wait() == 0, bridge.said
    assert times(bench.server.messages) == [*range(5)]


def test_a_program_that_fails_is_told_and_what_it_said_is_kept(bench, topology):
    bridge = array(bench, topology, *printing(0, 3, "raise SystemExit(7)"))
    assert bridge.wait() == 1
    assert "ended with status 7" in bridge.said
    bridge = array(bench, topology, *printing(3, 4))
    assert bridge.wait() == 0
    assert [times(messages) for messages in bench.server.stored.values()] == [[0, 1, 2], [3]]
    bridge = array(bench, topology, "no-such-program")
    assert bridge.wait() == 1
    assert "cannot start no-such-program" in bridge.said


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "wanted a JSON object"),
        ("[]", "wanted a JSON object"),
        ("{}", "got no array"),
        ('{"array": {"curves": []}}', "array.curves: List should have at least 1 item"),
        ('{"array": {"curves": [{"sensors": [0, 1], "spacing": []}]}}', "wanted 1 spacings between 2 sensors, got 0"),
        ('{"arrays": 1}', "arrays: Extra inputs are not permitted"),
    ],
)
def test_a_topology_that_is_none_is_said(text, why, tmp_path, capsys):
    (tmp_path / "t.json").write_text(text)
    status = main(["array", "--topology", str(tmp_path / "t.json"), "--spool", str(tmp_path / "s"), "true"])
    assert status == 1
    assert why in capsys.readouterr().err


def test_a_recording_of_an_array_is_replayed(bench, topology, capsys):
    declared = json.loads(Path(topology).read_text())
    hello = {"type": "hello", "recording": "r", "device": {"id": "a", "kind": "array", **declared}}
    readings = [{"type": "reading", "seq": n, "time": n / 100, **READING} for n in range(20)]
    file = bench.folder / "r.ndjson"
    file.write_text("".join(json.dumps(m) + "\n" for m in [hello, *readings]))
    assert main(["replay", str(file), "--server", bench.server.address, "--speed", "2"]) == 0
    assert times(bench.server.messages) == [n / 100 for n in range(20)]
