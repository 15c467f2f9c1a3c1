"""Runs queued reconstructions on embedded slots: one thread a slot claims a row, watches its worker and tells."""

import logging
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress

from tracemesh.errors import NotFound
from tracemesh.jobs.slot import Slot
from tracemesh.jobs.work import load_kernel, work
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import open_artifacts
from tracemesh.storage.database import Database
from tracemesh.storage.reconstructions import claim, finish, get_reconstruction, requeue, requeue_unfinished
from tracemesh.wire.resources import Reconstruction

WATCH_INTERVAL = 0.1
"""s between two looks at the row of a running job."""
log = logging.getLogger(__name__)


class JobRunner:
    """The table says what is to do; this only does it. `listener` is called, on a slot's thread, when a row changes."""

    def __init__(self, settings: Settings, database: Database, listener: Callable[[Reconstruction], None]) -> None:
        """Take up everything that a server before this one left unfinished."""
        self._settings = settings
        self._database = database
        self._listener = listener
        self._waiting: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._store = open_artifacts(settings)
        self._slots = [Slot() for _ in range(settings.job_slots)]
        with database.write() as transaction:
            for identifier in requeue_unfinished(transaction):
                self._waiting.put(identifier)
        self._threads = [threading.Thread(target=self._serve, args=(slot,), name="job slot") for slot in self._slots]
        for thread in self._threads:
            thread.start()

    def submit(self, identifier: str) -> None:
        """Run a queued reconstruction as soon as a slot is free."""
        self._waiting.put(identifier)

    def prepare(self) -> None:
        """Start the workers and let them load the kernel: whoever scans will want a reconstruction."""
        for slot in self._slots:
            with suppress(BrokenProcessPool):  # closing, or lost: the next job finds out
                slot.submit(load_kernel)

    def close(self) -> None:
        """Stop at once; running jobs are taken up again at the next start."""
        self._closing.set()
        for _ in self._threads:
            self._waiting.put(None)
        for slot in self._slots:
            slot.close()
        for thread in self._threads:
            thread.join()

    def _serve(self, slot: Slot) -> None:
        while (identifier := self._waiting.get()) is not None and not self._closing.is_set():
            try:
                self._run(slot, identifier)
            except Exception:
                log.exception("reconstruction %s: its slot failed", identifier)

    def _run(self, slot: Slot, identifier: str) -> None:
        with self._database.write() as transaction:
            attempt = claim(transaction, identifier)
        if attempt is None:
            return
        database_url = self._settings.resolved_database_url
        try:
            future = slot.submit(work, database_url, self._store, identifier, attempt)
            self._watch(future, identifier)
            future.result()
        except BrokenProcessPool:
            slot.renew()
            self._lost(identifier, attempt)
        except Exception:
            log.exception("reconstruction %s failed", identifier)
            with self._database.write() as transaction:
                finish(transaction, identifier, attempt, "failed", "an error inside tracemesh; the server's log has it")
        self._tell(identifier, None)

    def _watch(self, future: Future[None], identifier: str) -> None:
        seen: Reconstruction | None = None
        while not wait([future], WATCH_INTERVAL).done:
            seen = self._tell(identifier, seen)

    def _tell(self, identifier: str, seen: Reconstruction | None) -> Reconstruction | None:
        try:
            with self._database.read() as transaction:
                present = get_reconstruction(transaction, identifier)
        except NotFound:  # its session was deleted meanwhile
            return seen
        if present != seen:
            self._listener(present)
        return present

    def _lost(self, identifier: str, attempt: int) -> None:
        if self._closing.is_set():
            return
        log.warning("reconstruction %s: the process of attempt %d was lost", identifier, attempt)
        with self._database.write() as transaction:
            again = requeue(transaction, identifier, attempt)
        if again:
            self._waiting.put(identifier)
