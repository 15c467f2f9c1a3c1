"""Tells in plain words what is wrong between a Morphorider and the server, and what to do about it."""

import itertools
import math
import os
import statistics
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from tracemesh.wire.base import Vector
from tracemesh.wire.device import Device, Wheel
from tracemesh_bridge.health import Host, dip
from tracemesh_bridge.record import TOKEN_VARIABLE
from tracemesh_bridge.source import Link, Reading
from tracemesh_bridge.sources.morphorider import Morphorider, MorphoriderSettings, find_port
from tracemesh_bridge.uplink import failure, ingest_url

SLOW = 20.0
"""Samples per second below which a hand must be slow: at 8 cm/s a sample every 4 mm."""
MOST_FAULTS = 0.1
FULL_SCALE = 0.999
STEADY_FIELD = 0.1
"""Largest standard deviation of |magnetic|, as a part of its mean, of a field without iron nearby."""
STEADY_DIP = math.radians(4.0)


@dataclass(frozen=True)
class Finding:
    """One thing looked at. advice: what to do; empty if all is well."""

    what: str
    advice: str = ""

    def __str__(self) -> str:
        """As the operator reads it."""
        return f"  ok  {self.what}" if not self.advice else f"  !!  {self.what}\n      {self.advice}"


def examine(settings: MorphoriderSettings, seconds: float, server: str | None) -> Iterator[Finding]:
    """Look at port, device and server; what depends on something broken is not looked at."""
    if server is not None:
        yield check_server(server)
    port = check_port(settings.port)
    yield port
    if not port.advice:
        readings, faults, last_words = _listen(settings, seconds)
        yield from check_device(readings, faults, seconds, last_words)


def check_port(pattern: str) -> Finding:
    """Whether there is such a port, and whether we may open it."""
    path = find_port(pattern)
    if path is None:
        there = ", ".join(sorted(p.device for p in list_ports.comports())) or "none"
        return Finding(
            f"there is no port {pattern}; the ports of this computer: {there}",
            "switch the device on and plug it in; over Bluetooth: pair it and bind it, rfcomm bind 0 ADDRESS",
        )
    if "://" not in path and not os.access(path, os.R_OK | os.W_OK):
        group = Path(path).group()
        return Finding(f"you may not open {path}", f"join its group: sudo usermod -aG {group} $USER, then log in again")
    return Finding(f"port {path}")


def check_server(address: str) -> Finding:
    """Whether a server takes recordings there, from us."""
    url = ingest_url(address)
    token = os.environ.get(TOKEN_VARIABLE, "")
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        with connect(url, additional_headers=headers, open_timeout=5, close_timeout=1):
            return Finding(f"server {url}")
    except (OSError, TimeoutError, WebSocketException) as error:
        return Finding(f"no server at {url}: {failure(error)}", "start one with tracemesh serve, or give its --server")


def check_device(
    readings: Sequence[Reading], faults: Counter[str], seconds: float, last_words: str = ""
) -> Iterator[Finding]:
    """What the readings of so many seconds tell about the device."""
    asked = len(readings) + sum(faults.values())
    if len(readings) < 2:
        yield _silent(faults, last_words)
        return
    yield _rate(len(readings) / seconds)
    share = sum(faults.values()) / asked
    told = ", ".join(f"{count} {kind}" for kind, count in sorted(faults.items())) or "none"
    advice = "bring the device nearer; charge it; if most are implausible, try another --layout"
    yield Finding(f"faults in {asked} answers: {told}", advice if share > MOST_FAULTS else "")
    yield _changes(readings)
    yield from _vectors("accelerometer", [r.acceleration for r in readings if r.acceleration])
    magnetic = [r.magnetic for r in readings if r.magnetic]
    yield from _vectors("magnetometer", magnetic)
    yield _field(readings, magnetic)
    yield _wheel(readings)


def _listen(settings: MorphoriderSettings, seconds: float) -> tuple[list[Reading], Counter[str], str]:
    said: list[str] = []
    host, stop = Host(Link("device", said.append)), threading.Event()
    source = Morphorider(settings, Device(id="doctor", kind="morphorider", wheel=Wheel()), host)
    timer = threading.Timer(seconds, stop.set)
    timer.start()
    readings = list(source.readings(stop))
    timer.join()
    return readings, host.health.faults, said[-1] if said else ""


def _silent(faults: Counter[str], last_words: str) -> Finding:
    if faults["implausible"] or faults["short"]:
        told = f"{faults['implausible']} implausible and {faults['short']} short answers, no good one"
        return Finding(told, "another firmware? look at its bytes with tracemesh-bridge inspect, and write a --layout")
    why = f" ({last_words})" if last_words else ""
    return Finding(f"the device does not answer{why}", "is it switched on and charged, and is this its port?")


def _rate(rate: float) -> Finding:
    slow = rate < SLOW
    return Finding(
        f"{rate:.0f} samples per second", "bring it nearer to the computer, or move it slowly" if slow else ""
    )


def _changes(readings: Sequence[Reading]) -> Finding:
    frozen = len({(r.acceleration, r.magnetic) for r in readings}) == 1
    advice = "sensors are never that quiet: switch the device off and on"
    return Finding("every answer is the same" if frozen else "answers change", advice if frozen else "")


def _vectors(name: str, vectors: Sequence[Vector]) -> Iterator[Finding]:
    at_limit = sum(any(abs(c) >= FULL_SCALE for c in v) for v in vectors)
    if at_limit:
        advice = "a magnet is too near, or the layout's scale is wrong" if name == "magnetometer" else "do not shake it"
        yield Finding(f"{name}: {at_limit} of {len(vectors)} readings are at the end of its range", advice)


def _field(readings: Sequence[Reading], magnetic: Sequence[Vector]) -> Finding:
    lengths = [math.hypot(*m) for m in magnetic]
    spread = _robust_deviation(lengths) / statistics.median(lengths)
    dips = [dip(r.acceleration, r.magnetic) for r in readings if r.acceleration and r.magnetic]
    angle = _robust_deviation(dips)
    told = f"field |mag| {statistics.median(lengths):.3g} ± {100 * spread:.0f} %, "
    told += f"dip {math.degrees(statistics.median(dips)):.0f} ± {math.degrees(angle):.1f}°"
    steady = spread <= STEADY_FIELD and angle <= STEADY_DIP
    return Finding(
        told, "" if steady else "there is iron or a magnet near, or the device was shaken: try another place"
    )


def _robust_deviation(values: Sequence[float]) -> float:
    """Standard deviation of values of which a few may be pure chance."""
    middle = statistics.median(values)
    return 1.4826 * statistics.median(abs(v - middle) for v in values)


def _wheel(readings: Sequence[Reading]) -> Finding:
    turns = [r.ticks for r in readings if r.ticks]
    steps = [b != a for a, b in itertools.pairwise(turns)]
    if any(steps):
        return Finding(f"the wheel counts: {turns[0]} to {turns[-1]} (turns, ticks)")
    return Finding("the wheel did not turn", "roll the device while the doctor looks, or its wheel does not count")
