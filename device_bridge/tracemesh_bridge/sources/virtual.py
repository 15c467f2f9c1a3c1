"""A virtual Morphorider: a pseudo-terminal that answers like the device while it scans a built-in shape.

It is a process like any device is a thing: the bridge opens its port and cannot tell the difference. The operator's
keys come out of it in time, to be piped into the bridge. Faults can be injected, each with a probability per request.
"""

import os
import random
import select
import sys
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from tracemesh.geometry import shapes
from tracemesh.geometry.simulation import COUNTS, Handling, Imperfections, ScanPlan, plan_scan
from tracemesh_bridge.framing import Frame, FrameLayout, encode

SHAPES: dict[str, Callable[[], shapes.Shape]] = {
    f.__name__: f for f in (shapes.leaf, shapes.sphere, shapes.torus, shapes.cone, shapes.egg)
}
FAULTS = ("short", "garbage", "silent", "late", "surplus", "duplicate")
LATE_BY = 0.4


@dataclass(frozen=True)
class VirtualSettings:
    """What the virtual device does.

    speed: how many times faster than life. pace: `clock`, the ride goes on by itself; `request`, it advances by one
    reading per request, so that what is sent does not depend on how fast the computer is. link: symbolic link to the
    port, for a name known beforehand. faults: probability of each per request. unplug: number of the request after
    which the port vanishes, to come back under another name. log: file that receives every whole frame sent, in hex.
    """

    shape: str = "leaf"
    speed: float = 1.0
    pace: Literal["clock", "request"] = "clock"
    seed: int = 0
    noise: float = 1.0
    link: Path | None = None
    faults: tuple[tuple[str, float], ...] = ()
    unplug: int | None = None
    log: Path | None = None


def run_virtual(settings: VirtualSettings) -> None:
    """Be the device until the ride is over."""
    plan = plan_scan(SHAPES[settings.shape](), Handling(), Imperfections().scaled(settings.noise), settings.seed)
    ride = _Ride(plan, settings)
    with _Port(settings.link) as port:
        _say(f"virtual Morphorider ({settings.shape}, {plan.duration / settings.speed:.0f} s) at {port.name}")
        while not ride.over:
            ride.press_keys()
            if port.request(ride.patience):
                port.write(ride.answer())
                if ride.requests == settings.unplug:
                    port.replug()
                    _say(f"unplugged and back at {port.name}")


class _Ride:
    """Where the device is, what it answers, and which keys are due."""

    def __init__(self, plan: ScanPlan, settings: VirtualSettings) -> None:
        self._plan = plan
        self._settings = settings
        self._generator = np.random.default_rng(settings.seed)
        self._chance = random.Random(settings.seed)
        self._layout = FrameLayout()
        self._keys = list(operator_keys(plan))
        self._began: float | None = None
        self.requests = 0

    @property
    def time(self) -> float:
        """s since the ride began with the first request."""
        if self._settings.pace == "request":
            return self.requests / self._plan.handling.rate
        return 0.0 if self._began is None else (time.monotonic() - self._began) * self._settings.speed

    @property
    def over(self) -> bool:
        """Every key was pressed."""
        return not self._keys

    @property
    def patience(self) -> float:
        """s until the next key is due, or a while if only requests move the ride on."""
        if self._settings.pace == "request" or self._began is None:
            return 1.0
        return max(0.0, (self._keys[0][0] - self.time) / self._settings.speed)

    def press_keys(self) -> None:
        """Print the keys that are due."""
        while self._keys and self._keys[0][0] <= self.time:
            _, keys = self._keys.pop(0)
            try:
                os.write(sys.stdout.fileno(), f"{keys}\n".encode())
            except BrokenPipeError:
                _say("nobody reads the operator's keys any more")

    def answer(self) -> bytes:
        """What the device says to one request: a frame, or a fault."""
        self._began = time.monotonic() if self._began is None else self._began
        self.requests += 1
        raw = self._plan.readings(np.array([self.time]), self._generator)
        turns, small = (int(t) for t in raw.ticks[0])
        acceleration, magnetic = (_vector(v[0]) for v in (raw.acceleration, raw.magnetic))
        return self._spoil(encode(self._layout, Frame((turns, small), acceleration, magnetic)))

    def _spoil(self, frame: bytes) -> bytes:
        fault = self._next_fault()
        noise = self._chance.randbytes(len(frame))
        said = {
            "short": frame[: len(frame) // 2],
            "garbage": noise,
            "silent": b"",
            "surplus": frame + noise[:5],
            "duplicate": frame + frame,
        }.get(fault, frame)
        if fault == "late":
            time.sleep(LATE_BY)
        if self._settings.log and said.startswith(frame):
            with self._settings.log.open("a") as log:
                log.write(f"{frame.hex()}\n")
        return said

    def _next_fault(self) -> str:
        dice = self._chance.random()
        for name, probability in self._settings.faults:
            if dice < probability:
                return name
            dice -= probability
        return ""


class _Port:
    """A pseudo-terminal with an optional link to it."""

    def __init__(self, link: Path | None) -> None:
        self._link = link
        self._plugs = 0

    def __enter__(self) -> "_Port":
        self._plug(self._link)
        return self

    def __exit__(self, *_: object) -> None:
        self._unplug()

    def request(self, patience: float) -> bool:
        """Wait for a request; whether one came."""
        ready, _, _ = select.select([self._master], [], [], patience)
        # One byte is one request. The bridge's end may have been closed and opened again: that is no error here.
        return bool(ready) and os.read(self._master, 1) == b"Q"

    def write(self, data: bytes) -> None:
        """Answer."""
        os.write(self._master, data)

    def replug(self) -> None:
        """Vanish, and come back under another name."""
        self._unplug()
        time.sleep(0.3)
        self._plugs += 1
        self._plug(self._link.with_name(f"{self._link.name}.{self._plugs}") if self._link else None)

    def _plug(self, link: Path | None) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)
        self._linked = link
        if link:
            link.unlink(missing_ok=True)
            link.symlink_to(self.name)
            self.name = str(link)

    def _unplug(self) -> None:
        if self._linked:
            self._linked.unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self._master)


def operator_keys(plan: ScanPlan) -> Iterator[tuple[float, str]]:
    """What the operator types, and when (s since the ride began)."""
    curves = iter(plan.curves)
    for press in plan.keys:
        match press.key:
            case "boundary":
                yield press.time, "-"
            case "interior":
                yield press.time, "+"
            case "node":
                yield press.time, str(press.node)
            case "end":
                yield press.time, "*" if next(curves).closed else "."
    yield plan.duration + 0.5, "q"


def _vector(counts: np.ndarray[tuple[int], np.dtype[np.int64]]) -> tuple[float, float, float]:
    x, y, z = (float(c) / (COUNTS + 1) for c in counts)
    return (x, y, z)


def _say(words: str) -> None:
    print(words, file=sys.stderr, flush=True)
