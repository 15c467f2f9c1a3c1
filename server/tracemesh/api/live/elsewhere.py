"""What other servers on the same database do, shown and counted here as if it happened here."""

import asyncio
import logging

from sqlalchemy import select

from tracemesh.api.live.hub import Hub
from tracemesh.api.live.tracker import Accepted
from tracemesh.errors import NotFound
from tracemesh.storage.database import Database
from tracemesh.storage.devices import corrected_hello
from tracemesh.storage.exchange import News
from tracemesh.storage.models import CurveRow, ReadingRow, RecordingRow
from tracemesh.storage.readings import StoredReading
from tracemesh.storage.reconstructions import get_reconstruction
from tracemesh.storage.recordings import recording_messages
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Hello, from_device
from tracemesh.wire.resources import Reconstruction

log = logging.getLogger(__name__)


class Elsewhere:
    """Hears news and reads from the database what somebody here watches; on one event loop."""

    def __init__(self, database: Database, hub: Hub) -> None:
        """Nothing was heard yet."""
        self._database = database
        self._hub = hub
        self._news: asyncio.Queue[News] = asyncio.Queue()
        self._task = asyncio.create_task(self._run())

    def hear(self, news: News) -> None:
        """Something happened elsewhere."""
        if self._hub.is_watched(news.session):
            self._news.put_nowait(news)

    def missed(self) -> None:
        """Something may have happened anywhere."""
        for session in self._hub.watched:
            self._hub.edited(session)

    async def close(self) -> None:
        """Hear no more."""
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def _run(self) -> None:
        while True:
            await self._show(await self._news.get())

    async def _show(self, news: News) -> None:
        try:
            if news.kind == "edited":
                self._hub.edited(news.session)
            elif news.kind == "left":
                self._hub.left_elsewhere(news.session, int(news.subject))
            elif news.kind == "progressed":
                self._hub.progressed(await asyncio.to_thread(self._reconstruction, news.subject))
            elif (first := await self._hub.wanted(news.session, int(news.subject))) is not None:
                hello, fresh = await asyncio.to_thread(self._recorded, int(news.subject), first)
                self._hub.accepted_elsewhere(news.session, int(news.subject), hello, fresh)
        except NotFound:
            pass  # deleted meanwhile: whoever watches is told by other news
        except Exception:
            log.exception("session %s: what another server did cannot be shown", news.session)

    def _reconstruction(self, identifier: str) -> Reconstruction:
        with self._database.read() as transaction:
            return get_reconstruction(transaction, identifier)

    def _recorded(self, key: int, first: int) -> tuple[Hello, list[Accepted | StoredReading]]:
        """A recording's messages from number `first` on."""
        with self._database.read() as transaction:
            recording = transaction.get(RecordingRow, key)
            if recording is None:
                raise NotFound(f"there is no recording {key}")
            hello = corrected_hello(transaction, recording)
            messages = [from_device.validate_json(payload) for payload in recording_messages(transaction, key, first)]
            curves = select(CurveRow.number, CurveRow.index).where(CurveRow.recording_key == key)
            readings = select(ReadingRow.seq, ReadingRow.index).where(
                ReadingRow.recording_key == key, ReadingRow.seq >= first
            )
            indices = dict(transaction.execute(curves).all())
            numbers = dict(transaction.execute(readings).all())
        news: list[Accepted | StoredReading] = []
        for message in messages:
            if isinstance(message, ArrayReading):
                news.append(StoredReading(numbers[message.seq], recording.id, hello.device, message))
            elif not isinstance(message, Hello):
                news.append(Accepted(key, hello.device, indices[message.curve], message))
        return hello, news
