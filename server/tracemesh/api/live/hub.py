"""All rooms and all devices; the only place where what is recorded meets what is watched."""

import asyncio
import logging
from collections import defaultdict
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures.process import BrokenProcessPool

from tracemesh.api.live.client import Client
from tracemesh.api.live.meter import Meter
from tracemesh.api.live.room import Room, Stored
from tracemesh.api.live.tracker import Accepted, SessionTracker
from tracemesh.errors import TracemeshError
from tracemesh.jobs.attached import SolvedNetwork, solve_attached
from tracemesh.jobs.readings import SolvedReading, draw_reading
from tracemesh.jobs.slot import Slot
from tracemesh.storage.database import Database
from tracemesh.storage.readings import StoredReading, newest_readings
from tracemesh.storage.reconstructions import list_reconstructions
from tracemesh.storage.states import RecordingState
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Hello, Recorded, Samples
from tracemesh.wire.resources import Reconstruction

log = logging.getLogger(__name__)


class Hub:
    """To be used on one event loop."""

    def __init__(self, database: Database, database_url: str, flush: Callable[[], Awaitable[None]]) -> None:
        """`flush` waits until everything accepted is committed."""
        self._database = database
        self._database_url = database_url
        self._flush = flush
        self._rooms: dict[str, Room] = {}
        self._meters: dict[str, dict[int, Meter]] = defaultdict(dict)
        self._slot = Slot()
        self._array_slot = Slot()
        self._one_at_a_time = asyncio.Lock()

    @property
    def watcher_count(self) -> int:
        """Browsers that watch."""
        return sum(len(room.clients) for room in self._rooms.values())

    async def close(self) -> None:
        """Send everybody away."""
        for room in self._rooms.values():
            for client in room.clients:
                client.end()
            await room.close()
        await asyncio.to_thread(self._slot.close)
        await asyncio.to_thread(self._array_slot.close)

    def connected(self, state: RecordingState) -> None:
        """A device begins to send."""
        self._meters[state.session.id][state.key] = Meter(state.hello)

    def disconnected(self, state: RecordingState) -> None:
        """A device is gone; watchers see it as lost until nobody watches."""
        self._meters[state.session.id][state.key].connected = False
        if state.session.id not in self._rooms:
            self._forget_lost(state.session.id)

    def accepted(self, state: RecordingState, message: Recorded) -> None:
        """Show a message that the recorder took; costs next to nothing while nobody watches."""
        meter = self._meters.get(state.session.id, {}).get(state.key)
        if meter is not None and isinstance(message, Samples | ArrayReading):
            meter.add(message)
        room, device = self._rooms.get(state.session.id), state.hello.device
        if room is None:
            return
        if isinstance(message, ArrayReading):
            room.show(StoredReading(state.session.next_reading - 1, state.hello.recording, device, message))
        else:
            room.take(Accepted(state.key, device, state.curves[message.curve].index, message))

    def edited(self, session: str) -> None:
        """Curves or marks of a session were edited."""
        if session in self._rooms:
            self._rooms[session].reload()

    def is_watched(self, session: str) -> bool:
        """Whether somebody watches."""
        return session in self._rooms

    @property
    def watched(self) -> list[str]:
        """Sessions that somebody watches."""
        return list(self._rooms)

    async def wanted(self, session: str, key: int) -> int | None:
        """Number of the first message of a recording that watchers have not seen; None while nobody watches."""
        return await self._rooms[session].next_seq(key) if session in self._rooms else None

    def accepted_elsewhere(
        self, session: str, key: int, hello: Hello, news: Sequence[Accepted | StoredReading]
    ) -> None:
        """Show what another server stored."""
        if session not in self._rooms:
            return
        room, meter = self._rooms[session], self._meters[session].setdefault(key, Meter(hello, is_here=False))
        meter.connected = True
        for item in news:
            if isinstance(item, StoredReading):
                meter.add(item.reading)
                room.show(item)
                room.passed(key, item.reading.seq)
            else:
                if isinstance(item.message, Samples):
                    meter.add(item.message)
                room.take(item)

    def left_elsewhere(self, session: str, key: int) -> None:
        """A device has left another server."""
        meter = self._meters.get(session, {}).get(key)
        if meter is not None and not meter.is_here:
            meter.connected = False

    def progressed(self, reconstruction: Reconstruction) -> None:
        """A reconstruction changed."""
        if reconstruction.session in self._rooms:
            self._rooms[reconstruction.session].tell(reconstruction)

    def join(self, session: str) -> tuple[Room, Client]:
        """Somebody watches."""
        if session not in self._rooms or self._rooms[session].stopped:
            self._rooms[session] = Room(session, self._meters[session], self._load, self._solve, self._draw)
        room, client = self._rooms[session], Client()
        room.enter(client)
        return room, client

    async def leave(self, room: Room, client: Client) -> None:
        """Somebody watches no more; the last one puts out the light."""
        room.leave(client)
        if not room.clients and self._rooms.get(room.session) is room:
            del self._rooms[room.session]
            self._forget_lost(room.session)
            await room.close()

    def _forget_lost(self, session: str) -> None:
        meters = self._meters.pop(session, {})
        kept = {key: meter for key, meter in meters.items() if meter.connected and meter.is_here}
        if kept:
            self._meters[session] = kept

    async def _load(self, session: str) -> Stored:
        await self._flush()  # what comes from now on is in the room's hands

        def read() -> Stored:
            with self._database.read() as transaction:
                tracker = SessionTracker.load(transaction, session)
                reconstruction = next(iter(list_reconstructions(transaction, 1, session=session)), None)
                return Stored(tracker, reconstruction, newest_readings(transaction, session))

        await self._flush()  # what was accepted before somebody watched is told to nobody: it must be in the database
        return await asyncio.to_thread(read)

    async def _solve(self, session: str) -> SolvedNetwork | None:
        """In another process, one network at a time: drawing and recording go on meanwhile."""
        async with self._one_at_a_time:
            await self._flush()
            try:
                return await asyncio.wrap_future(self._slot.submit(solve_attached, self._database_url, session))
            except BrokenProcessPool:
                self._slot.renew()
            except Exception:
                log.exception("session %s: the network could not be solved; its curves are drawn as reckoned", session)
            return None

    async def _draw(self, stored: StoredReading) -> SolvedReading | None:
        """In a process that does nothing else: an array's rate does not wait for other networks."""
        device = stored.device.model_dump_json()
        try:
            return await asyncio.wrap_future(self._array_slot.submit(draw_reading, device, stored.reading))
        except BrokenProcessPool:
            self._array_slot.renew()
        except TracemeshError as error:
            log.info("recording %s cannot be drawn: %s", stored.recording, error)
        return None
