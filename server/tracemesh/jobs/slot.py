"""A slot: one worker process, made anew after it was lost. A killed worker costs only its own job."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from multiprocessing.context import BaseContext
from typing import TypeVar

T = TypeVar("T")
LOADED = ["tracemesh.pipeline", "tracemesh.jobs.work", "tracemesh.jobs.warm"]
"""Modules of what workers do; they take long to import."""


class Slot:
    """Runs one function after another in a process of its own, started when it is first needed; from any thread."""

    def __init__(self, niceness: int = 0, memory: int | None = None) -> None:
        """No process yet. niceness: how far it stands back behind others; memory: most bytes that it may take."""
        self._niceness = niceness
        self._memory = memory
        self._pool: ProcessPoolExecutor | None = None
        self._closed = False
        self._lock = threading.Lock()

    def connect(self) -> None:
        """Nothing: the process starts when it is needed."""

    def prepare(self, function: Callable[..., object]) -> None:
        """Run something beforehand, so that the next function finds a process that is ready."""
        self.submit(function)

    def submit(self, function: Callable[..., T], *arguments: object) -> Future[T]:
        """Run in the process; the future raises BrokenProcessPool when the process is lost.

        Raises BrokenProcessPool when the slot is closed, or when no process can be had just now.
        """
        with self._lock:
            if self._closed:
                raise BrokenProcessPool("the slot is closed")
            try:
                return self._started().submit(function, *arguments)
            except (OSError, EOFError) as error:
                raise BrokenProcessPool(f"no process could be started: {error}") from None

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            begin = (dict(os.environ), self._niceness, self._memory)
            self._pool = ProcessPoolExecutor(1, mp_context=_context(), initializer=_begin, initargs=begin)
        return self._pool

    def renew(self) -> None:
        """End the process, if it was not lost; the next submission starts another one."""
        pool = self._taken()
        if pool is not None:
            for process in list((pool._processes or {}).values()):
                process.kill()
            pool.shutdown(wait=True, cancel_futures=True)

    def close(self) -> None:
        """End the process at once, for good; what it was doing is left undone."""
        self._closed = True
        self.renew()

    def _taken(self) -> ProcessPoolExecutor | None:
        with self._lock:
            pool, self._pool = self._pool, None
            return pool


def _context() -> BaseContext:
    """On Linux a worker is a copy of one process that has loaded the kernel: there at once, its memory shared."""
    if sys.platform != "linux":  # elsewhere system libraries do not bear to be copied
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(LOADED)
    return context


def _begin(environment: dict[str, str], niceness: int, memory: int | None) -> None:
    """What a worker process does first; the one that it is a copy of has the environment of its own start."""
    os.environ.update(environment)
    if sys.platform != "win32":  # which has neither
        import resource

        os.nice(niceness)
        if memory is not None:
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    _end_with_parent()


def _end_with_parent() -> None:
    """A server killed with -9 cannot end its workers; they watch it instead. A Ctrl-C is for the server alone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            wait([parent.sentinel])
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
