"""A dask cluster, by the address of its scheduler.

Its workers need the same tracemesh, and reach the same database and the same artifacts as the server does.
"""

import logging
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future
from contextlib import suppress
from typing import TypeVar

from distributed import Client, KilledWorker
from distributed import Future as DaskFuture

from tracemesh.errors import ClusterAway

T = TypeVar("T")
PATIENCE = 5
"""s to wait for each answer of the scheduler; dask itself may wait for ever, above all while it closes."""


class Cluster:
    """Connected when it is first needed, and again after its scheduler was away; one for all jobs of a server."""

    def __init__(self, address: str) -> None:
        """`address` as dask has it: tcp://HOST:PORT."""
        self._address = address
        self._client: Client | None = None
        self._lock = threading.Lock()
        self._closed = False
        for name in ("distributed.client", "distributed.core", "distributed.comm"):  # the runner says it once
            logging.getLogger(name).setLevel(logging.CRITICAL)

    def connect(self) -> None:
        """Be connected to a scheduler that has workers; raises ClusterAway."""
        try:
            there = self._connected().nthreads(callback_timeout=PATIENCE)
        except (OSError, RuntimeError) as error:
            raise ClusterAway(self._away(error)) from None
        if not there:
            raise ClusterAway(f"the scheduler at {self._address} has no workers")

    def submit(self, function: Callable[..., T], *arguments: object) -> Future[T]:
        """Run on a worker; the future raises ClusterAway or, when the worker was lost, BrokenExecutor."""
        outer: Future[T] = Future()
        outer.set_running_or_notify_cancel()
        try:
            inner = self._connected().submit(function, *arguments, pure=False)
            inner.add_done_callback(lambda done: _hand_over(done, outer))
        except (OSError, RuntimeError) as error:  # between the connection and now
            raise ClusterAway(self._away(error)) from None
        return outer

    def prepare(self, function: Callable[..., object]) -> None:
        """Nothing: workers of a cluster live longer than a server."""

    def renew(self) -> None:
        """Nothing: what was given up stops by itself when it next asks its row, and its worker serves others too."""

    def close(self) -> None:
        """Leave the cluster."""
        with self._lock:
            self._closed = True
            self._leave()

    def _connected(self) -> Client:
        with self._lock:
            if self._closed:
                raise ClusterAway("the server stops")
            if self._client is not None and self._client.status == "running":
                return self._client
            self._leave()
            try:
                self._client = Client(self._address, timeout=PATIENCE, set_as_default=False, name="tracemesh")
            except (OSError, TimeoutError) as error:
                raise ClusterAway(self._away(error)) from None
            return self._client

    def _leave(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with suppress(OSError, TimeoutError):  # the scheduler is gone already
                client.close(timeout=PATIENCE)

    def _away(self, error: Exception) -> str:
        return f"the scheduler at {self._address} does not answer: {error}"


def _hand_over(done: DaskFuture[T], outer: "Future[T]") -> None:
    """Give a future's end to another one."""
    try:
        outer.set_result(_result(done))
    except Exception as error:
        outer.set_exception(error)


def _result(done: DaskFuture[T]) -> T:
    """What it ended with, in the words of the standard library."""
    try:
        if done.status == "finished":
            return done.result(PATIENCE)
        error = done.exception(PATIENCE) if done.status == "error" else None
    except TimeoutError:
        error = None
    if error is None:
        raise ClusterAway("the scheduler was lost")
    if isinstance(error, KilledWorker):
        raise BrokenExecutor("the worker was lost")
    raise error
