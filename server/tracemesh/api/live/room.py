"""Everybody who watches one session: messages in, changes drawn at frame rate, the same text to every browser."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from time import monotonic

from pydantic import BaseModel

from tracemesh.api.live.client import Client
from tracemesh.api.live.meter import Meter
from tracemesh.api.live.readings import live_reading
from tracemesh.api.live.tracker import Accepted, SessionTracker
from tracemesh.errors import NotFound
from tracemesh.jobs.attached import SolvedNetwork
from tracemesh.jobs.readings import SolvedReading
from tracemesh.storage.readings import StoredReading
from tracemesh.wire.device import CurveEnd, NodeMark
from tracemesh.wire.live import LiveReading, LiveReconstruction, LiveWatchers, Snapshot
from tracemesh.wire.resources import Reconstruction

FRAME = 1 / 60
"""s between two updates of what is drawn."""
HEALTH_INTERVAL = 0.5
"""s between two readings of the devices' health."""
MAX_PENDING = 20_000
"""Messages that wait to be drawn, before the session is rather read again from the database."""
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Stored:
    """A session as it is in the database; `readings`: the newest one of every array."""

    tracker: SessionTracker
    reconstruction: Reconstruction | None
    readings: list[StoredReading]


class Room:
    """Lives while somebody watches."""

    def __init__(
        self,
        session: str,
        meters: dict[int, Meter],
        load: Callable[[str], Awaitable[Stored]],
        solve: Callable[[str], Awaitable[SolvedNetwork | None]],
        draw: Callable[[StoredReading], Awaitable[SolvedReading | None]],
    ) -> None:
        """`meters`: of the session's devices, kept by the caller; `load` and `solve` read what is committed.

        `draw`: solves a reading of an array.
        """
        self.session = session
        self.clients: set[Client] = set()
        self.stopped = False
        self._meters = meters
        self._load = load
        self._solve = solve
        self._draw_reading = draw
        self._tracker = SessionTracker()
        self._reconstruction: Reconstruction | None = None
        self._pending: list[Accepted] = []
        self._newest: dict[str, StoredReading] = {}
        self._drawn: dict[str, LiveReading] = {}
        self._stale = True
        self._changed = asyncio.Event()
        self._unsolved = asyncio.Event()
        self._undrawn = asyncio.Event()
        self._loaded = asyncio.Event()
        works = (self._draw, self._settle, self._draw_readings, self._tell_health)
        self._tasks = [asyncio.create_task(self._guard(work)) for work in works]

    async def close(self) -> None:
        """Nobody watches any more."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def enter(self, client: Client) -> None:
        """Somebody watches."""
        self.clients.add(client)
        self._tell_watchers()

    def leave(self, client: Client) -> None:
        """Somebody watches no more."""
        self.clients.discard(client)
        self._tell_watchers()

    def _tell_watchers(self) -> None:
        self._broadcast(LiveWatchers(count=len(self.clients)), replaces="watchers")

    def take(self, accepted: Accepted) -> None:
        """A message was accepted; drawn at the next frame."""
        self._pending.append(accepted)
        if len(self._pending) > MAX_PENDING:
            self.reload()
        self._changed.set()

    def show(self, reading: StoredReading) -> None:
        """An array was read: drawn as soon as the one before it is, unless a newer one comes meanwhile."""
        drawn = self._drawn.get(reading.recording)
        if drawn is None or drawn.number < reading.number:
            self._newest[reading.recording] = reading
            self._undrawn.set()

    def reload(self) -> None:
        """What is stored was edited: read it again."""
        self._pending.clear()
        self._stale = True
        self._changed.set()

    async def next_seq(self, key: int) -> int:
        """Number of the first message of a recording that is not drawn yet."""
        await self._loaded.wait()
        return self._tracker.next_seq(key)

    def passed(self, key: int, seq: int) -> None:
        """A message of a recording was shown otherwise."""
        self._tracker.passed(key, seq)

    def tell(self, reconstruction: Reconstruction) -> None:
        """A reconstruction made progress."""
        self._reconstruction = reconstruction
        self._broadcast(LiveReconstruction(reconstruction=reconstruction))

    async def snapshot(self) -> str:
        """Everything a late joiner needs."""
        await self._loaded.wait()
        network = self._tracker.network()
        return Snapshot(
            session=self.session,
            curves=network.curves,
            nodes=network.nodes,
            devices=[meter.read() for meter in self._meters.values()],
            readings=list(self._drawn.values()),
            reconstruction=self._reconstruction,
            watchers=len(self.clients),
        ).model_dump_json()

    def _broadcast(self, message: BaseModel, replaces: str = "") -> None:
        text = message.model_dump_json()
        for client in self.clients:
            client.push(text, replaces)

    async def _draw(self) -> None:
        while True:
            if self._stale:
                await self._read_again()
            await self._changed.wait()
            self._changed.clear()
            accepted, self._pending = self._pending, []
            for change in self._tracker.take(accepted):
                self._broadcast(change)
            if any(isinstance(a.message, NodeMark | CurveEnd) for a in accepted):
                self._unsolved.set()
            await asyncio.sleep(FRAME)

    async def _read_again(self) -> None:
        self._stale = False
        told = self._reconstruction
        stored = await self._load(self.session)
        self._tracker = stored.tracker
        if self._reconstruction is told:  # else there was news while reading
            self._reconstruction = stored.reconstruction
        for reading in stored.readings:
            if reading.recording not in self._newest:  # else a newer one came while reading
                self.show(reading)
        self._loaded.set()
        self._unsolved.set()
        for client in self.clients:
            client.need_snapshot()

    async def _settle(self) -> None:
        """One solution at a time; marks that come meanwhile make one more."""
        while True:
            await self._unsolved.wait()
            self._unsolved.clear()
            tracker = self._tracker
            solved = await self._solve(self.session)
            if solved is not None and tracker is self._tracker and not self._stale:
                self._broadcast(tracker.settle(solved))

    async def _draw_readings(self) -> None:
        """The newest reading of every array, one solution at a time."""
        while True:
            await self._undrawn.wait()
            self._undrawn.clear()
            began = monotonic()
            newest, self._newest = self._newest, {}
            for stored in newest.values():
                solved = await self._draw_reading(stored)
                if solved is not None:
                    self._drawn[stored.recording] = drawn = live_reading(stored, solved)
                    self._broadcast(drawn, replaces=stored.recording)
            await asyncio.sleep(max(0.0, began + FRAME - monotonic()))

    async def _tell_health(self) -> None:
        while True:
            for meter in self._meters.values():
                self._broadcast(meter.read())
            await asyncio.sleep(HEALTH_INTERVAL)

    async def _guard(self, work: Callable[[], Awaitable[None]]) -> None:
        try:
            await work()
        except NotFound:
            log.info("session %s is gone", self.session)
        except Exception:
            log.exception("live view of session %s stopped", self.session)
        self.stopped = True
        for client in self.clients:
            client.end()
