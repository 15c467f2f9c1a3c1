"""Sensor Logger's messages: parsed, and put into order.

Each POST holds a batch: {"messageId", "sessionId", "deviceId", "payload": [{"name", "time", "values"}]}, time in ns
since 1970. Messages may come twice and out of order; `messageId` counts them.
"""

import json
from dataclasses import dataclass
from typing import Any

from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.health import Health

VECTORS = ("gravity", "accelerometer", "magnetometer", "gyroscope")
MOST_AHEAD = 20
"""Messages that may have come early before one that is missing is given up."""
PATIENCE = 3.0
"""s for which a missing message is waited for."""


@dataclass(frozen=True)
class Entry:
    """One value of one sensor. time: ns since 1970, the phone's clock; as a float it would be good for 240 ns."""

    name: str
    time: int
    values: dict[str, float]


@dataclass(frozen=True)
class Batch:
    """One POST."""

    number: int
    session: str
    phone: str
    entries: tuple[Entry, ...]
    received: float


class Reorder:
    """Puts messages into order by their number, each once; a missing one is waited for, but not for ever."""

    def __init__(self, health: Health) -> None:
        """Messages that came twice, or never, are counted by `health`."""
        self._health = health
        self._session = ""
        self._next = 0
        self._early: dict[int, Batch] = {}
        self._waiting_since = 0.0

    def add(self, batch: Batch) -> list[Batch]:
        """What can be read now that this message has come."""
        given_up: list[Batch] = []
        if batch.session != self._session:
            given_up = self._give_up()
            self._session, self._next = batch.session, 0 if batch.number < MOST_AHEAD else batch.number
        if batch.number < self._next or batch.number in self._early:
            self._health.fault("repeated")
            return given_up
        if not self._early:
            self._waiting_since = batch.received
        self._early[batch.number] = batch
        ready = given_up + self._ready()
        return ready + (self._give_up() if len(self._early) > MOST_AHEAD else [])

    def late(self, now: float) -> list[Batch]:
        """What can be read because a missing message was waited for long enough."""
        return self._give_up() if self._early and now - self._waiting_since > PATIENCE else []

    def _ready(self) -> list[Batch]:
        ready = []
        while self._next in self._early:
            ready.append(self._early.pop(self._next))
            self._next += 1
        return ready

    def _give_up(self) -> list[Batch]:
        given_up: list[Batch] = []
        while self._early:
            missing = min(self._early) - self._next
            if missing:
                self._health.fault("missing", missing)
            self._next += missing
            given_up += self._ready()
        return given_up


def parse_batch(body: bytes, received: float) -> Batch:
    """The batch in the body of a POST. Raises BridgeError with what is wrong."""
    try:
        message = json.loads(body)
        entries = tuple(e for e in map(_entry, message["payload"]) if e is not None)
        return Batch(int(message["messageId"]), str(message["sessionId"]), str(message["deviceId"]), entries, received)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
        raise BridgeError(f"wanted a message of Sensor Logger, got {body[:80]!r}") from error


def _entry(entry: dict[str, Any]) -> Entry | None:
    name = str(entry["name"]).lower().replace(" ", "")
    if name != "orientation" and name not in VECTORS:
        return None
    keys = ("qw", "qx", "qy", "qz") if name == "orientation" else ("x", "y", "z")
    values = {key: float(entry["values"][key]) for key in keys}
    if any(v - v != 0 for v in values.values()):
        raise ValueError("not finite")
    time = int(entry["time"])
    if abs(time) >= 2**63:
        raise ValueError("no time")
    return Entry(name, time, values)
