"""A virtual Morphorider: a pseudo-terminal that answers like the device while it scans a built-in shape.

It is a process like any device is a thing: the bridge opens its port and cannot tell the difference. The operator's
keys come out of it in time, to be piped into the bridge. Faults can be injected, each with a probability per request.
"""

import os
import select
import signal
import sys
import time
import tty
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tracemesh_bridge.errors import BridgeError

FAULTS = ("short", "garbage", "silent", "late", "surplus", "duplicate")
LATE_BY = 0.4
PATIENCE = 1.0
"""s without a request after which a device whose ride is over leaves."""


@dataclass(frozen=True)
class VirtualSettings:
    """What the virtual device does.

    speed: how many times faster than life. pace: `clock`, the ride goes on by itself; `request`, it advances by one
    reading per request, so that what is sent does not depend on how fast the computer is. link: symbolic link to the
    port, for a name known beforehand. faults: probability of each per request. unplug: number of the request after
    which the port vanishes, to come back under another name. log: file that receives every whole frame sent, in hex.
    calibrating: it is led through a calibration instead of over the shape. distortion: file with the calibration that
    would correct its sensors and its wheel.
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
    calibrating: bool = False
    distortion: Path | None = None


def run_virtual(settings: VirtualSettings) -> None:
    """Be the device until the ride is over and nobody asks any more. Raises BridgeError if there is no such shape."""
    from tracemesh_bridge.sources.ride import Ride  # late: it needs much that no other command does

    ride = Ride(settings)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # not without removing the link: its port is soon another's
    with _Port(settings.link) as port:
        what = "calibration" if settings.calibrating else settings.shape
        say(f"virtual Morphorider ({what}, {ride.duration:.0f} s) at {port.name}")
        while not ride.over:
            if port.request(ride.patience):
                port.write(ride.answer())
                if ride.requests == settings.unplug:
                    port.replug()
                    say(f"unplugged and back at {port.name}")
            ride.press_keys()
        while port.request(PATIENCE):  # the ride is over, but a device does not vanish before it is let go
            port.write(ride.answer())


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
        if link and link.exists() and not link.is_symlink():
            raise BridgeError(f"wanted a name for a new link, got {link}, which is there and is no link")
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


def say(words: str) -> None:
    """One line for people; stdout is the operator's keyboard."""
    print(words, file=sys.stderr, flush=True)
