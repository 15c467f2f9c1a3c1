"""Worker processes: what they may take, what they are copies of, and what becomes of them."""

import os
import resource
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from tests.jobs.support import kill, origins, until, wait_for_end
from tracemesh.jobs.slot import Slot
from tracemesh.jobs.work import load_kernel

GIVEN = "A_VARIABLE_OF_THE_TESTS"


@pytest.fixture
def slots() -> Iterator[list[Slot]]:
    """Two, of which one has little memory."""
    made = [Slot(), Slot(memory=2**29)]
    yield made
    for slot in made:
        slot.close()


def test_a_process_has_no_more_memory_than_it_may_take(slots: list[Slot]) -> None:
    with pytest.raises(MemoryError):
        slots[1].submit(bytearray, 2**29).result()
    assert slots[1].submit(len, b"goes on").result() == 7
    assert len(slots[0].submit(bytes, 2**29).result()) == 2**29


def test_workers_are_copies_of_one_process_with_the_environment_of_today(
    slots: list[Slot], monkeypatch: pytest.MonkeyPatch
) -> None:
    slots[0].submit(load_kernel).result()
    monkeypatch.setenv(GIVEN, "today's")
    assert slots[1].submit(os.getenv, GIVEN).result() == "today's"
    assert slots[0].submit(os.getenv, GIVEN).result() is None
    (origin,) = origins()
    assert [slot.submit(os.getppid).result() for slot in slots] == [origin, origin]


def test_a_lost_origin_is_made_anew_and_leaves_no_orphan(slots: list[Slot]) -> None:
    worker, before = slots[0].submit(os.getpid).result(), slots[0].submit(os.getppid).result()
    kill([before])
    with pytest.raises(BrokenExecutor):
        until(lambda: slots[0].submit(int).result() != 0)
    wait_for_end([worker])
    assert [_origin(slots[0])] == origins() != [before]


def _origin(slot: Slot) -> int:
    """Of its process; as whoever has work does, once more where it was lost just now."""
    found: list[int] = []

    def ask() -> bool:
        slot.renew()
        with suppress(BrokenExecutor):
            found.append(slot.submit(os.getppid).result())
        return bool(found)

    until(ask)
    return found[0]


def test_what_cannot_be_started_is_lost_not_wrong(slots: list[Slot]) -> None:
    """No process is left to be had: with BrokenExecutor the job waits for the next attempt."""
    begun = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (len(list(Path("/proc/self/fd").iterdir())), begun[1]))
    try:
        with pytest.raises(BrokenExecutor):
            slots[0].submit(int)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, begun)
    slots[0].renew()
    assert slots[0].submit(int).result() == 0
