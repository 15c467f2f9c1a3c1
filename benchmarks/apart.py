"""Work done in a process of its own: cold, its memory seen alone, and stopped when it takes too long."""

from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from time import process_time
from typing import Generic, TypeVar

Result = TypeVar("Result")

_STATUS = Path("/proc/self/status")


@dataclass(frozen=True)
class Measured(Generic[Result]):
    """result: what the work returned. seconds: processor time, imports not counted. memory: bytes above what imports
    took, or None where the system does not tell.
    """

    result: Result
    seconds: float
    memory: int | None


def apart(budget: float, work: Callable[..., Result], *args: object) -> Measured[Result] | None:
    """Call a module's function in a new process; None when that takes more than `budget` seconds or it dies."""
    context = get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_report, args=(there, work, args), daemon=True)
    process.start()
    there.close()
    try:
        measured: Measured[Result] | None = here.recv() if here.poll(budget) else None
    except EOFError:
        measured = None
    process.kill()
    process.join()
    return measured


def _report(pipe: Connection, work: Callable[..., object], args: tuple[object, ...]) -> None:
    before, begin = _peak(), process_time()
    result = work(*args)
    seconds, after = process_time() - begin, _peak()
    pipe.send(Measured(result, seconds, None if before is None or after is None else after - before))


def _peak() -> int | None:
    """Most memory that this process ever held, bytes. (getrusage tells the parent's where that was larger.)"""
    if not _STATUS.exists():
        return None
    line = next(line for line in _STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
    return 1024 * int(line.split()[1])
