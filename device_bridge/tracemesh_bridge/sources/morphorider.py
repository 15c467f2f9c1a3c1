"""The Morphorider: asked over a serial port (Bluetooth rfcomm, 115200 8N1), one frame per request.

Strict request-reply: a frame has no mark of where it starts, so it is "the bytes after my request", and there are never
two requests under way. After a late or short answer everything still coming is read and dropped before the next one.
The wheel's counters are cumulative: a dropped frame costs a sample, never distance.
"""

import glob
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import serial

from tracemesh.wire.device import Device, Wheel
from tracemesh_bridge.errors import FrameError
from tracemesh_bridge.framing import Frame, FrameLayout, decode
from tracemesh_bridge.health import Host
from tracemesh_bridge.source import LinkState, Reading

QUIET = 0.03
"""s without a byte after which a device is taken to have finished speaking."""
MOST_READS = 30
TOP_SPEED = 3.0
"""m/s: more than a hand moves a wheel; a faster counter is not believed."""
REPEATS = 5
"""Frames in a row that contradict the last counter but agree with each other: then it is the counter that restarted."""
STALE_AFTER, LOST_AFTER = 1.0, 5.0
"""s without a good frame after which a device counts as stale, and after which its port is opened again."""
SEARCH_PERIOD = 0.5


@dataclass(frozen=True)
class MorphoriderSettings:
    """How to reach the device. port: a path, or a pattern such as /dev/rfcomm* whose last match is used; rate: most
    requests per second; timeout: s to wait for an answer.
    """

    port: str
    rate: float = 60.0
    timeout: float = 0.25
    layout: FrameLayout = field(default_factory=FrameLayout)


class Morphorider:
    """The device as a source of readings."""

    def __init__(self, settings: MorphoriderSettings, device: Device, host: Host) -> None:
        """`device` goes into the recording's hello; the wheel in it is the one believed."""
        self.device = device
        self._settings = settings
        self._host = host
        self._link = host.link
        self._odometer = _Odometer(device.wheel or Wheel())

    def readings(self, stop: threading.Event) -> Iterator[Reading]:
        """Every good frame, until `stop` is set; a lost device is found again, at another port too."""
        while not stop.is_set():
            port = find_port(self._settings.port)
            if port is None:
                self._link.to(LinkState.SEARCHING, f"no port {self._settings.port}")
            else:
                self._link.to(LinkState.OPENING, port)
                try:
                    with open_port(port, self._settings.timeout) as line:
                        yield from self._frames(line, port, stop)
                except (OSError, serial.SerialException) as error:
                    self._link.down(f"{port}: {_words(error)}")
            stop.wait(SEARCH_PERIOD)

    def _frames(self, line: serial.Serial, port: str, stop: threading.Event) -> Iterator[Reading]:
        due = last_good = self._host.clock.now()
        period = 1 / self._settings.rate
        while not stop.is_set():
            frame = self._ask(line)
            now = self._host.clock.now()
            reading = self._believe(frame, now) if frame else None
            if reading:
                last_good = now
                self._link.to(LinkState.LIVE, port)
                yield reading
            elif now - last_good > LOST_AFTER:
                self._link.down(f"{port}: no good answer for {LOST_AFTER:.0f} s; is the device switched on?")
                return
            elif now - last_good > STALE_AFTER and self._link.state is LinkState.LIVE:
                self._link.to(LinkState.STALE, f"{port}: no good answer for {STALE_AFTER:.0f} s")
            due = max(due + period, now - period)  # a reading or two late is made up for, no more
            stop.wait(max(0.0, due - now))

    def _believe(self, frame: Frame, now: float) -> Reading | None:
        ticks = self._odometer.follow(frame.ticks, now)
        if ticks is None:
            self._host.health.fault("implausible")
            return None
        reading = Reading(received=now, ticks=ticks, acceleration=frame.acceleration, magnetic=frame.magnetic)
        self._host.health.take(reading)
        return reading

    def _ask(self, line: serial.Serial) -> Frame | None:
        """One request and its answer, or None and a counted fault."""
        layout = self._settings.layout
        if line.in_waiting:
            self._host.health.fault("surplus")
            drain(line)
        line.write(bytes([layout.request]))
        data = line.read(layout.length)
        try:
            return decode(layout, data)
        except FrameError:
            whole = len(data) == layout.length
            self._host.health.fault("implausible" if whole else "short" if data else "late")
            drain(line)
            return None


class _Odometer:
    """Believes a wheel counter only if a hand could have turned the wheel that far since the last frame.

    A counter that starts again (power cycled, 16 bits used up) goes on from where it was, so that a curve being scanned
    stays whole.
    """

    def __init__(self, wheel: Wheel) -> None:
        self._wheel = wheel
        self._offset = 0
        self._believed: tuple[int, float] | None = None
        self._doubted: tuple[int, float] | None = None
        self._repeats = 0

    def follow(self, ticks: tuple[int, int], now: float) -> tuple[int, int] | None:
        """The counter, continued over restarts, or None if it is not believed (yet)."""
        count = ticks[0] * self._wheel.ticks_per_turn + ticks[1]
        if self._believed and not self._reachable(self._believed, count, now):
            agrees = self._doubted is not None and self._reachable(self._doubted, count, now)
            self._repeats = self._repeats + 1 if agrees else 1
            self._doubted = (count, now)
            if self._repeats < REPEATS:
                return None
            self._offset += self._believed[0] - count
        self._believed, self._doubted, self._repeats = (count, now), None, 0
        return divmod(count + self._offset, self._wheel.ticks_per_turn) if self._offset else ticks

    def _reachable(self, before: tuple[int, float], count: int, now: float) -> bool:
        # One turn more: the two integers of a counter may be read just before and just after a turn is complete.
        turns = TOP_SPEED * (now - before[1]) / self._wheel.circumference + 1
        return abs(count - before[0]) <= turns * self._wheel.ticks_per_turn


def find_port(pattern: str) -> str | None:
    """The last port that matches, or None. A URL of pyserial's (socket://host:port, ...) is taken as it is."""
    if "://" in pattern:
        return pattern
    ports = glob.glob(pattern)  # noqa: PTH207 - an absolute pattern, which Path.glob refuses
    there = [p for p in ports if Path(p).exists()]  # a link may outlive its device
    return max(there, key=lambda p: (len(p), p), default=None)  # ttyUSB10 comes after ttyUSB9


def open_port(port: str, timeout: float) -> serial.Serial:
    """Open a port and drop what it still had to say. Raises serial.SerialException."""
    line = serial.serial_for_url(port, baudrate=115200, timeout=timeout, write_timeout=timeout, exclusive=True)
    drain(line)
    return line


def drain(line: serial.Serial) -> bytes:
    """Read until the device is quiet, but not forever: one that never is gets no request that way."""
    said = b""
    timeout, line.timeout = line.timeout, QUIET
    try:
        for _ in range(MOST_READS):
            data = line.read(4096)
            said += data
            if not data:
                break
    finally:
        line.timeout = timeout
    return said


def _words(error: Exception) -> str:
    if isinstance(error, PermissionError) or "Permission denied" in str(error):
        return "no permission to open it: add yourself to the group that owns it (dialout on most systems)"
    return str(error)
