"""Sends a recording that lies in a file: the server then has the same session as if the device were there."""

import asyncio
import os
import time
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Hello, Recorded, Samples, from_device
from tracemesh_bridge.console import Console
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.record import TOKEN_VARIABLE
from tracemesh_bridge.source import Link
from tracemesh_bridge.uplink import Uplink

TICK = 0.05


class RecordedFile:
    """A recording in a file, as a log that can be sent. Messages are released at once, or in the time they took."""

    first_seq = 0

    def __init__(self, place: Path, speed: float | None = None) -> None:
        """`speed`: times faster than it was recorded; None: at once. Raises BridgeError with the line at fault."""
        self.place = place
        self.hello, messages = _read(place)
        self.next_seq = len(messages)
        self._lines = [m.model_dump_json(exclude_none=True) for m in messages]
        self._due = list(_due(messages, speed))
        self._began = time.monotonic()

    @property
    def released(self) -> int:
        """How many messages may be sent by now."""
        now = time.monotonic() - self._began
        return next((seq for seq, due in enumerate(self._due) if due > now), self.next_seq)

    def lines(self, seq: int) -> "_Lines":
        """The messages from `seq` on."""
        return _Lines(self, seq)

    def line(self, seq: int) -> str:
        """One message."""
        return self._lines[seq]

    def acknowledge(self, seq: int) -> None:
        """The file stays as it is."""


class _Lines:
    def __init__(self, file: RecordedFile, seq: int) -> None:
        self.seq = seq
        self._file = file

    def next(self) -> str | None:
        if self.seq >= self._file.released:
            return None
        self.seq += 1
        return self._file.line(self.seq - 1)


def replay(file: RecordedFile, server: str) -> str:
    """Send a recording; the session that it is in then.

    Goes on until the server has all of it; raises Refused when the server does not want it.
    """
    return asyncio.run(_replay(file, server))


async def _replay(file: RecordedFile, server: str) -> str:
    uplink = Uplink(server, os.environ.get(TOKEN_VARIABLE, ""), file, Link("server", Console().say))

    async def release() -> None:
        while True:
            uplink.wake()
            await asyncio.sleep(TICK)

    tasks = [asyncio.ensure_future(uplink.run()), asyncio.ensure_future(release())]
    try:
        await uplink.finished_or_refused()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    return uplink.session


def _read(place: Path) -> tuple[Hello, list[Recorded]]:
    try:
        lines = place.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BridgeError(f"cannot read the recording {place}: {error}") from error
    hello: Hello | None = None
    messages: list[Recorded] = []
    for number, line in enumerate(lines, start=1):
        try:
            message = from_device.validate_json(line)
        except ValidationError as error:
            raise BridgeError(f"{place}: line {number}: {error.errors()[0]['msg']}") from error
        if isinstance(message, Hello):
            hello = hello or message
        elif hello is None or message.seq != len(messages):
            wanted = "hello" if hello is None else f"message {len(messages)}"
            raise BridgeError(f"{place}: line {number}: wanted {wanted}, got {message.type} {message.seq}")
        else:
            messages.append(message)
    if hello is None:
        raise BridgeError(f"{place}: wanted a recording that begins with hello, got nothing")
    return hello, messages


def _times(message: Recorded) -> list[float] | None:
    if isinstance(message, ArrayReading):
        return [message.time if message.received is None else message.received]
    return (message.received or message.time) if isinstance(message, Samples) else None


def _due(messages: list[Recorded], speed: float | None) -> Iterator[float]:
    """s after the beginning at which each message is due; marks when the samples before them are."""
    began: float | None = None
    due = 0.0
    for message in messages:
        times = _times(message)
        if times and speed is not None:
            began = times[0] if began is None else began
            due = max(due, (times[-1] - began) / speed)
        yield due
