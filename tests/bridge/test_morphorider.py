"""The Morphorider source against the virtual device, and against devices that no virtual one is rude enough to be."""

import os
import select
import socket
import struct
import threading
import time
import tty
from contextlib import suppress
from itertools import islice

import pytest

from tracemesh.wire.device import Device, Wheel
from tracemesh_bridge.framing import Frame, FrameLayout, encode
from tracemesh_bridge.health import Host
from tracemesh_bridge.source import Link, LinkState
from tracemesh_bridge.sources import morphorider
from tracemesh_bridge.sources.morphorider import REPEATS, Morphorider, MorphoriderSettings, find_port, open_port

DEVICE = Device(id="d", kind="morphorider", wheel=Wheel())


class Rig:
    """A source on a port, and what it says."""

    def __init__(self, port, **settings):
        self.said = []
        self.host = Host(Link("device", self.said.append))
        settings = MorphoriderSettings(str(port), **{"rate": 1000.0, "timeout": 0.1, **settings})
        self.source = Morphorider(settings, DEVICE, self.host)

    def frames(self, count):
        """So many readings, as the frames that the device sent, in hex."""
        stop = threading.Event()
        readings = list(islice(self.source.readings(stop), count))
        return [encode(FrameLayout(), Frame(r.ticks, r.acceleration, r.magnetic)).hex() for r in readings]


FAULTS = {
    "short": "short",
    "garbage": "implausible",
    "silent": "late",
    "late": "late",
    "surplus": "surplus",
    "duplicate": "surplus",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_counted_and_no_whole_frame_is_lost_or_doubled(bench, fault):
    bench.virtual(f"--{fault}", "0.04", "--seed", "4")
    rig = Rig(bench.folder / "rider", timeout=0.1 if fault == "late" else 0.5)
    frames, sent = rig.frames(100), bench.sent()
    places = [sent.index(frame) for frame in frames]
    assert places == sorted(set(places))
    assert rig.host.health.faults[FAULTS[fault]] > 0
    # A request that was given up may still be answered; then that answer, or the one after it, is surplus.
    given_up = rig.host.health.faults["late"] if fault == "late" else 0
    assert places[-1] + 1 - len(places) <= given_up
    assert rig.said == [f"device: live: {bench.folder / 'rider'}"]


@pytest.fixture
def wire():
    """A pseudo-terminal without anybody behind it."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def frame(turns, small, level=1):
    return struct.pack(">11h", turns, small, level, 0, 16384, 8192, 0, -14189, 0, 0, 0)


def answering(master, answers, delay=0.0):
    """A device that gives these answers, and how many requests waited each time."""
    waiting = []

    def serve():
        with suppress(OSError):  # the test is over and has closed the wire
            for answer in answers:
                request = os.read(master, 1)
                time.sleep(delay)
                more, _, _ = select.select([master], [], [], 0)
                waiting.append(request + os.read(master, 100) if more else request)
                os.write(master, answer)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    return waiting


def test_a_slow_device_never_has_two_requests_waiting(wire):
    master, port = wire
    waiting = answering(master, [frame(0, n) for n in range(1, 8)], delay=0.05)
    assert len(Rig(port).frames(6)) == 6
    assert set(waiting) == {b"Q"}


def test_what_a_device_said_before_it_was_asked_is_dropped(wire):
    master, port = wire
    os.write(master, b"booting...\r\n")
    answering(master, [frame(0, n) for n in range(1, 5)])
    assert Rig(port).frames(3) == [frame(0, n).hex() for n in range(1, 4)]


def test_the_rest_of_an_answer_that_comes_too_late_is_no_part_of_the_next_one(wire):
    master, port = wire
    good = [frame(0, n) for n in range(1, 5)]

    def serve():
        with suppress(OSError):
            for n, answer in enumerate(good):
                os.read(master, 1)
                os.write(master, answer[:12] if n == 1 else answer)
                if n == 1:
                    time.sleep(0.31)
                    os.write(master, answer[12:])

    threading.Thread(target=serve, daemon=True).start()
    rig = Rig(port, timeout=0.3)
    assert rig.frames(3) == [f.hex() for f in (good[0], good[2], good[3])]
    assert rig.host.health.faults == {"short": 1}


def test_a_device_that_babbles_is_not_waited_for_for_ever(wire, monkeypatch):
    master, port = wire
    monkeypatch.setattr(morphorider, "QUIET", 0.001)
    stop = threading.Event()

    def babble():
        while not stop.is_set():
            os.write(master, b"x")

    thread = threading.Thread(target=babble)
    thread.start()
    try:
        open_port(port, 0.1).close()
    finally:
        stop.set()
        os.set_blocking(master, False)
        thread.join()


def test_a_wheel_faster_than_a_hand_is_not_believed(wire):
    master, port = wire
    good = [frame(0, n) for n in range(10, 16)]
    answering(master, [*good[:3], frame(900, 7), frame(-30000, 400), *good[3:]])
    rig = Rig(port)
    assert rig.frames(6) == [f.hex() for f in good]
    assert rig.host.health.faults["implausible"] == 2


def test_a_counter_that_starts_again_goes_on_from_where_it_was(wire):
    master, port = wire
    answering(master, [*(frame(70, n) for n in (1, 2, 3)), *(frame(0, n) for n in range(REPEATS + 3))])
    frames = Rig(port).frames(6)
    ticks = [500 * turns + small for turns, small in (struct.unpack(">2h", bytes.fromhex(f)[:4]) for f in frames)]
    assert ticks == [35001, 35002, 35003, 35003, 35004, 35005]


def test_a_silent_device_is_stale_then_lost_then_found(wire, monkeypatch):
    master, port = wire
    monkeypatch.setattr(morphorider, "STALE_AFTER", 0.2)
    monkeypatch.setattr(morphorider, "LOST_AFTER", 0.5)
    monkeypatch.setattr(morphorider, "SEARCH_PERIOD", 0.05)
    answering(master, [frame(0, 1), *(b"" for _ in range(12)), *(frame(0, n) for n in range(2, 6))])
    rig = Rig(port, timeout=0.05)
    assert len(rig.frames(3)) == 3
    assert [line.split(": ")[1] for line in rig.said] == ["live", "stale", "searching", "live"]
    assert "is the device switched on?" in rig.said[2]


def test_no_port_is_said_once_and_the_bridge_stops_when_asked(tmp_path):
    rig, stop = Rig(tmp_path / "rfcomm*"), threading.Event()
    thread = threading.Thread(target=lambda: list(rig.source.readings(stop)))
    thread.start()
    time.sleep(0.1)
    stop.set()
    thread.join(10)
    assert not thread.is_alive()
    assert rig.said == [f"device: searching: no port {tmp_path / 'rfcomm*'}"]
    assert rig.host.link.state is LinkState.SEARCHING


def test_a_port_that_may_not_be_opened_says_what_to_do(tmp_path):
    (tmp_path / "port").write_text("no terminal")
    rig, stop = Rig(tmp_path / "port"), threading.Event()
    thread = threading.Thread(target=lambda: list(rig.source.readings(stop)))
    thread.start()
    time.sleep(0.1)
    stop.set()
    thread.join(10)
    assert str(tmp_path / "port") in rig.said[0]


def test_the_last_matching_port_is_used(tmp_path):
    for name in ("ttyUSB0", "ttyUSB1"):
        (tmp_path / name).touch()
    assert find_port(str(tmp_path / "ttyUSB*")) == str(tmp_path / "ttyUSB1")
    (tmp_path / "ttyUSB10").touch()
    (tmp_path / "ttyUSB11").symlink_to(tmp_path / "gone")
    assert find_port(str(tmp_path / "ttyUSB*")) == str(tmp_path / "ttyUSB10")
    assert find_port(str(tmp_path / "rfcomm*")) is None
    assert find_port("socket://bench:7000") == "socket://bench:7000"


def test_a_device_behind_a_network_socket():
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve():
            connection, _ = listening.accept()
            with connection, suppress(OSError):
                for n in range(1, 6):
                    connection.recv(1)
                    connection.sendall(frame(0, n))

        threading.Thread(target=serve, daemon=True).start()
        rig = Rig(f"socket://127.0.0.1:{listening.getsockname()[1]}", timeout=1.0)
        assert rig.frames(3) == [frame(0, n).hex() for n in (1, 2, 3)]
