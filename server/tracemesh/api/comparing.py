"""Compares surfaces with true ones, one at a time, beside everything else that the server does."""

import asyncio
from collections.abc import AsyncIterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from tracemesh.errors import TracemeshError
from tracemesh.jobs.comparison import Truth, compare
from tracemesh.jobs.slot import Slot
from tracemesh.wire.resources import Comparison, ComparisonProgress

if TYPE_CHECKING:
    from tracemesh.geometry.comparison.evaluation import Alignment

WATCH_INTERVAL = 0.1
"""s between two looks at how far it is."""


class Comparer:
    """One process, started when it is first needed. On one event loop."""

    def __init__(self) -> None:
        """No process yet."""
        self._slot = Slot()
        self._turn = asyncio.Lock()

    async def close(self) -> None:
        """End the process."""
        await asyncio.to_thread(self._slot.close)

    async def compare(
        self, mesh: Path, truth: Truth, align: "Alignment"
    ) -> AsyncIterator[ComparisonProgress | Comparison]:
        """How far it is, again and again, then the result. Raises TracemeshError."""
        async with self._turn:
            ear, mouth = Pipe(duplex=False)
            with ear, mouth:
                try:
                    doing = self._slot.submit(compare, mesh, truth, align, mouth)
                    async for progress in _watch(doing, ear):
                        yield progress
                    found: Comparison = await asyncio.wrap_future(doing)
                except BrokenProcessPool:
                    self._slot.renew()
                    raise TracemeshError("the process that does it was lost; ask again") from None
            yield found


async def _watch(
    doing: Future[Comparison], ear: "Connection[None, tuple[str, float]]"
) -> AsyncIterator[ComparisonProgress]:
    while not doing.done():
        while ear.poll():
            stage, fraction = ear.recv()
            yield ComparisonProgress(stage=stage, fraction=fraction)
        await asyncio.sleep(WATCH_INTERVAL)
