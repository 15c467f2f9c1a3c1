"""Runs queued reconstructions: one thread a worker claims a row, watches over its attempt and tells.

The table is the queue. Any number of servers may share it: each takes up what waits, and what another one lost.
"""

import logging
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, wait
from contextlib import contextmanager, suppress
from time import monotonic

from sqlalchemy.exc import SQLAlchemyError

from tracemesh.errors import ClusterAway, NotFound
from tracemesh.jobs.executor import Worker, make_workers
from tracemesh.jobs.work import load_kernel, work
from tracemesh.logs import about
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import open_artifacts
from tracemesh.storage.database import Database
from tracemesh.storage.reconstructions import (
    Claim,
    beat,
    claim_next,
    count_waiting,
    finish,
    get_reconstruction,
    lose,
    release,
    running,
)
from tracemesh.wire.resources import Reconstruction

WATCH_INTERVAL = 0.1
"""s between two looks at the row of a running job."""
BEAT = 1.0
"""s between two signs of life of a running job, and two looks at what other servers leave."""
LEASE = 10.0
"""s without a sign of life after which an attempt is lost."""
PATIENCE = 3.0
"""s between two attempts to reach a cluster, or a database, that is away."""
log = logging.getLogger(__name__)


class JobRunner:
    """The table says what is to do; this only does it. `listener` is called, on some thread, when a row changes."""

    def __init__(self, settings: Settings, database: Database, listener: Callable[[Reconstruction], None]) -> None:
        """Take up what waits and, after a while, everything that a lost server left unfinished."""
        self._settings = settings
        self._database = database
        self._listener = listener
        self._news = threading.Semaphore(0)
        self._closing = threading.Event()
        self._store = open_artifacts(settings)
        self._held: set[Claim] = set()
        self._others: dict[Claim, tuple[int, float]] = {}
        self._workers = make_workers(settings)
        self._threads = [threading.Thread(target=self._serve, args=(w,), name="job") for w in self._workers]
        self._threads.append(threading.Thread(target=self._keep, name="job keeper"))
        for thread in self._threads:
            thread.start()

    def wake(self) -> None:
        """Something was queued: run it as soon as a worker is free."""
        self._news.release()

    def prepare(self) -> None:
        """Start the workers and let them load the kernel: whoever scans will want a reconstruction."""
        for worker in self._workers:
            with suppress(BrokenExecutor):  # closing, or lost: the next job finds out
                worker.prepare(load_kernel)

    def close(self) -> None:
        """Stop at once; running jobs wait again, for another server or the next start."""
        self._closing.set()
        for _ in self._threads:
            self._news.release()
        for worker in self._workers:
            worker.close()
        for thread in self._threads:
            thread.join()

    def _serve(self, worker: Worker) -> None:
        while not self._closing.is_set():
            try:
                worker.connect()
                if not self._run_next(worker):
                    self._news.acquire()
            except ClusterAway as error:
                log.warning("jobs wait: %s", error)
                self._closing.wait(PATIENCE)
            except SQLAlchemyError as error:
                log.error("jobs wait: the database does not answer: %s", error)
                self._closing.wait(PATIENCE)

    def _run_next(self, worker: Worker) -> bool:
        """Run the first job in line; whether there was one."""
        with self._database.write() as transaction:
            claim = claim_next(transaction)
        if claim is None:
            return False
        with self._holding(claim):
            with about(job=claim.id):
                self._run(worker, claim)
            self._tell(claim, None)
        return True

    @contextmanager
    def _holding(self, claim: Claim) -> Iterator[None]:
        self._held.add(claim)
        try:
            yield
        finally:
            self._held.discard(claim)

    def _run(self, worker: Worker, claim: Claim) -> None:
        try:
            future = worker.submit(work, self._settings.resolved_database_url, self._store, claim)
            if self._watch(future, claim):
                future.result()
            else:
                worker.renew()
        except ClusterAway as error:
            log.warning("reconstruction %s waits again: %s", claim.id, error)
            self._end(release, claim)
        except BrokenExecutor:
            worker.renew()
            log.warning("reconstruction %s: the process of attempt %d was lost", claim.id, claim.attempt)
            self._end(release if self._closing.is_set() else lose, claim)
        except SQLAlchemyError:  # its row says that it runs: it is lost, and taken up again, when the lease is over
            worker.renew()
            raise
        except Exception:
            log.exception("reconstruction %s failed", claim.id)
            self._end(finish, claim, "failed", "an error inside tracemesh; the server's log has it")

    def _watch(self, future: Future[None], claim: Claim) -> bool:
        """Tell how far it is until it ends; False when it was given up."""
        seen: Reconstruction | None = None
        limit = self._settings.job_timeout
        deadline = monotonic() + limit
        while not wait([future], WATCH_INTERVAL).done:
            seen = self._tell(claim, seen)
            if self._closing.is_set():
                self._end(release, claim)
                return False
            if monotonic() > deadline:
                log.warning("reconstruction %s took longer than %d s", claim.id, limit)
                self._end(finish, claim, "failed", f"it took longer than {limit} s")
                return False
        return True

    def _tell(self, claim: Claim, seen: Reconstruction | None) -> Reconstruction | None:
        try:
            with self._database.read() as transaction:
                present = get_reconstruction(transaction, claim.id)
        except (NotFound, SQLAlchemyError):  # its session was deleted meanwhile, or the next look will do
            return seen
        if present != seen:
            self._listener(present)
        return present

    def _end(self, change: Callable[..., bool], claim: Claim, *arguments: object) -> None:
        with self._database.write() as transaction:
            change(transaction, claim, *arguments)

    def _keep(self) -> None:
        """Give signs of life, look for those of others, and for jobs that other servers queued."""
        while not self._closing.wait(BEAT):
            try:
                if held := set(self._held):
                    with self._database.write() as transaction:
                        beat(transaction, held)
                with self._database.read() as transaction:
                    present, waiting = running(transaction), count_waiting(transaction)
                lost = self._lost(present, monotonic())
                for claim in lost:
                    log.warning("reconstruction %s: nobody watches over attempt %d", claim.id, claim.attempt)
                    self._end(lose, claim)
                for _ in range(min(waiting + len(lost), len(self._workers))):
                    self._news.release()
            except SQLAlchemyError as error:
                log.error("the database does not answer: %s", error)

    def _lost(self, present: dict[Claim, int], now: float) -> list[Claim]:
        """Attempts of others whose beat stood still for too long."""
        others = {claim: beat for claim, beat in present.items() if claim not in self._held}
        before = self._others
        self._others = {
            claim: before[claim] if claim in before and before[claim][0] == beat else (beat, now)
            for claim, beat in others.items()
        }
        return [claim for claim, (_, since) in self._others.items() if now - since > LEASE]
