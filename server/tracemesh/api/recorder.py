"""The recorder: takes messages on the event loop, commits them in groups on one writer thread, acknowledges them after.

While one group is being committed the next one gathers, so more devices do not mean more commits.
"""

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from tracemesh.api.metrics import Metrics
from tracemesh.errors import Overtaken, Refused
from tracemesh.storage.database import Database
from tracemesh.storage.exchange import News, post
from tracemesh.storage.ingest import Group, commit, open_recording
from tracemesh.storage.sessions import delete_session
from tracemesh.storage.states import RecordingState, SessionState
from tracemesh.wire.device import Hello, Recorded

GATHER = 0.025
"""s between the beginnings of two commits, at least: each costs about the same, however many messages it holds."""
log = logging.getLogger(__name__)
T = TypeVar("T")


def _out_of_order() -> Refused:
    return Refused("storage", "the server cannot store messages now; keep them and connect again")


class Sender(Protocol):
    """Whoever sends a recording: a device's connection or an upload."""

    def acknowledge(self, seq: int) -> None:
        """Everything up to and including `seq` is durable."""

    def fail(self, reason: Refused) -> None:
        """Nothing more is taken from this sender."""


@dataclass(frozen=True)
class _Batch:
    group: Group = field(default_factory=Group)
    done: asyncio.Event = field(default_factory=asyncio.Event)


class Recorder:
    """Every write of recordings goes through here; to be used on one event loop."""

    def __init__(
        self,
        database: Database,
        max_session_bytes: int,
        observer: Callable[[RecordingState, Recorded], None],
        metrics: Metrics,
        owner: str,
    ) -> None:
        """`owner` tells this server from others on the same database.

        `observer` sees every message once, as soon as it is accepted; it must not wait."""
        self._database = database
        self._max_session_bytes = max_session_bytes
        self._observer = observer
        self._metrics = metrics
        self._owner = owner
        self._open: dict[int, tuple[RecordingState, Sender]] = {}
        self._deleting: set[str] = set()
        self._batch = _Batch()
        self._wake = asyncio.Event()
        self._lock = asyncio.Lock()
        self._closing = False
        self._writer = ThreadPoolExecutor(1, "recorder")
        self._task = asyncio.create_task(self._run())

    async def close(self) -> None:
        """Commit what was accepted, then stop."""
        self._closing = True
        self._wake.set()
        await self._task
        self._writer.shutdown()

    @property
    def open_count(self) -> int:
        """Recordings that somebody sends now."""
        return len(self._open)

    async def open(self, hello: Hello, payload: bytes, sender: Sender) -> RecordingState:
        """Begin or go on with a recording; another sender of the same one is cut off. Raises Refused."""
        async with self._lock:
            try:
                state = await self._write(open_recording, hello, payload, self._owner)
            except SQLAlchemyError:
                log.exception("could not open recording %s", hello.recording)
                raise _out_of_order() from None
            if state.session.id in self._deleting:
                raise Refused("unknown", f"there is no session {state.session.id}")
            elsewhere = Refused("limit", "the recording goes on over another connection")
            if state.taken_over:
                self._drop(state.key, elsewhere)
            if state.key in self._open:
                state, before = self._open[state.key]
                before.fail(elsewhere)
            else:
                state.session = self._shared(state.session)
            self._open[state.key] = state, sender
            await self.flush()
            return state

    async def leave(self, state: RecordingState, sender: Sender) -> bool:
        """The sender is gone; what it sent is committed first. Whether nobody else sends the recording now."""
        async with self._lock:
            await self.flush()
            if state.key in self._open and self._open[state.key][1] is sender:
                del self._open[state.key]
            return state.key not in self._open

    def stored_elsewhere(self, session: str, next_index: int) -> None:
        """Another server gave away the indices of a session's curves below `next_index`."""
        for state, _ in self._open.values():
            if state.session.id == session:
                state.session.catch_up(SessionState(session, next_index, 0, 0))

    def accept(self, state: RecordingState, message: Recorded, payload: bytes) -> None:
        """Take a message; one that was sent before is only acknowledged again. Raises Refused."""
        if self._closing or state.key not in self._open or self._open[state.key][0] is not state:
            raise Refused("storage", "the recording is not open any more; connect again")
        if message.seq < state.next_seq:
            self._batch.group.acknowledge(state)
        else:
            state.check(message)
            self._check_size(state, len(payload))
            state.advance(message, len(payload))
            self._batch.group.add(state, message, payload)
            self._observer(state, message)
        self._wake.set()

    async def flush(self) -> None:
        """Wait until everything accepted so far is durable."""
        batch = self._batch
        self._wake.set()
        if not self._task.done():
            await batch.done.wait()

    async def delete_session(self, identifier: str) -> None:
        """Cut off who records into a session, then delete it. Raises NotFound."""
        self._deleting.add(identifier)
        try:
            for key, (state, sender) in list(self._open.items()):
                if state.session.id == identifier:
                    sender.fail(Refused("unknown", f"session {identifier} was deleted"))
                    del self._open[key]
            await self.flush()
            await self._write(delete_session, identifier)
        finally:
            self._deleting.discard(identifier)

    def _shared(self, session: SessionState) -> SessionState:
        """One state for all recordings of a session, so that they do not give two curves one index."""
        known = (state.session for state, _ in self._open.values() if state.session.id == session.id)
        shared = next(known, session)
        shared.catch_up(session)
        return shared

    def _check_size(self, state: RecordingState, size: int) -> None:
        if state.session.bytes + size > self._max_session_bytes:
            raise Refused("limit", f"session {state.session.id} would exceed {self._max_session_bytes} bytes")

    async def _write(self, work: Callable[..., T], *arguments: object) -> T:
        """Run `work` in a transaction of its own on the writer thread."""

        def transaction() -> T:
            with self._database.write() as session:
                return work(session, *arguments)

        return await asyncio.get_running_loop().run_in_executor(self._writer, transaction)

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        while not self._closing or self._batch.group.reached:
            await self._wake.wait()
            self._wake.clear()
            batch, self._batch = self._batch, _Batch()
            began = loop.time()
            if batch.group.reached:
                await self._commit(batch.group)
            batch.done.set()
            if not self._closing:
                await asyncio.sleep(began + GATHER - loop.time())
        self._batch.done.set()

    async def _commit(self, group: Group) -> None:
        try:
            with self._metrics.commits.time():
                await self._write_own(group)
        except Exception:
            log.exception("could not commit %d messages", len(group.messages))
            self._fail_all()
            return
        self._metrics.messages.inc(len(group.messages))
        self._metrics.bytes.inc(sum(len(row["payload"]) for row in group.messages))
        for key, row in group.reached.items():
            if key in self._open:
                state, sender = self._open[key]
                state.committed = row.next_seq
                sender.acknowledge(state.committed - 1)

    async def _write_own(self, group: Group) -> None:
        """Leaves out what another server was faster with."""
        while group.reached:
            try:
                await self._write(self._store, group, self._news(group))
                break
            except Overtaken as news:
                for key, reason in news.reasons.items():
                    group.drop(key)
                    self._drop(key, reason)

    def _news(self, group: Group) -> list[News]:
        states = (self._open[key][0] for key in group.reached if key in self._open)
        return [News("recorded", s.session.id, str(s.key), s.session.next_index) for s in states]

    def _store(self, transaction: Session, group: Group, news: list[News]) -> None:
        commit(transaction, group, self._owner)
        post(transaction, self._owner, news)

    def _drop(self, key: int, reason: Refused) -> None:
        self._batch.group.drop(key)
        if key in self._open:
            _, sender = self._open.pop(key)
            sender.fail(reason)

    def _fail_all(self) -> None:
        """What is in memory runs ahead of what could be stored: everybody has to go back to what is durable."""
        for _, sender in self._open.values():
            sender.fail(_out_of_order())
        self._open.clear()
        self._batch.done.set()
        self._batch = _Batch()
