"""What every device, real or virtual, looks like to the bridge."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.base import Quaternion, Vector
from tracemesh.wire.device import Device


@dataclass(frozen=True)
class Reading:
    """One sample as the device gave it; the names, units and axes are those of `tracemesh.wire.device.Samples`."""

    received: float
    time: float | None = None
    ticks: tuple[int, int] | None = None
    acceleration: Vector | None = None
    magnetic: Vector | None = None
    rotation_rate: Vector | None = None
    quaternion: Quaternion | None = None


class LinkState(StrEnum):
    """How a connection is, to a device or to the server."""

    SEARCHING = "searching"
    OPENING = "opening"
    LIVE = "live"
    STALE = "stale"
    LOST = "lost"


class Link:
    """The state of one connection, and its log: one line when it goes down, one when it is up."""

    def __init__(self, name: str, say: Callable[[str], None]) -> None:
        """`name` heads each line given to `say`."""
        self.name = name
        self.state = LinkState.SEARCHING
        self._say = say
        self._said = ""

    def to(self, state: LinkState, words: str = "") -> None:
        """Enter a state; `words` say where to, or why."""
        went_down = self.state is LinkState.LIVE and state is not LinkState.LIVE
        came_up = state is LinkState.LIVE and self.state is not LinkState.LIVE
        still_down = state is LinkState.SEARCHING and words != self._said
        self.state = state
        if came_up or went_down or still_down:
            self._said = words
            self._say(f"{self.name}: {state}" + (f": {words}" if words else ""))

    def note(self, words: str) -> None:
        """Say something about the connection that does not change its state."""
        self._say(f"{self.name}: {words}")

    def down(self, why: str) -> None:
        """The connection is gone, or could not be made: search again."""
        if self.state in (LinkState.LIVE, LinkState.STALE):
            self.to(LinkState.LOST, why)
        self.to(LinkState.SEARCHING, why)


class Source(Protocol):
    """A device. Blocking code in a thread of its own: sources stay simple, and a slow one delays nobody else."""

    device: Device

    def readings(self, stop: threading.Event) -> Iterator[Reading | ArrayReading]:
        """Every sample, or reading of an array, in the order measured, until `stop` is set.

        Finds a lost device again by itself.
        """
        ...
