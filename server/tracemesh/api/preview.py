"""The network while somebody moves a slider: no queue, no files; only the newest wish of each client is worked on."""

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from tracemesh.api.live.drawing import flat
from tracemesh.api.live.readings import array_curves, live_reading, node_positions
from tracemesh.errors import Conflict, InputError, ScanError, TracemeshError
from tracemesh.formats.rawnet import write_rawnet
from tracemesh.formats.recordings import with_marks
from tracemesh.geometry.curves.closed_curves import begun_at_nodes
from tracemesh.geometry.scan import Scan
from tracemesh.jobs.attached import SolvedNetwork
from tracemesh.jobs.problems import find_problems
from tracemesh.jobs.proposals import propose_nodes
from tracemesh.jobs.readings import SolvedReading, draw_reading, solve_reading
from tracemesh.jobs.slot import Slot
from tracemesh.storage.curves import list_curves
from tracemesh.storage.database import Database
from tracemesh.storage.models import new_id
from tracemesh.storage.readings import StoredReading, is_of_array, load_reading
from tracemesh.storage.scans import load_sent
from tracemesh.wire.live import LiveCurve, LiveReading, Preview
from tracemesh.wire.resources import (
    Curve,
    CurveMarks,
    NetworkProblem,
    NetworkProblems,
    NodeProposals,
    PreviewWish,
)

MAX_SCANS = 8
"""Sessions whose scan is kept in memory."""
T = TypeVar("T")


@dataclass(frozen=True)
class Loaded:
    """What a session amounted to when it was read; `name` tells it from what the session was before or is later."""

    name: str
    scan: Scan
    indices: list[int]
    curves: list[Curve]


class Previewer:
    """Keeps the scans of the sessions last asked for, and one process that keeps them ready. On one event loop."""

    def __init__(self, database: Database, flush: Callable[[], Awaitable[None]], budget: int) -> None:
        """`flush` waits until everything accepted is committed; budget: bytes of what the process keeps ready."""
        self._budget = budget
        self._database = database
        self._flush = flush
        self._slot = Slot()
        self._turn = asyncio.Lock()
        self._scans: OrderedDict[str, asyncio.Future[Loaded]] = OrderedDict()
        self._newest: dict[tuple[str, str], object] = {}

    async def close(self) -> None:
        """End the process."""
        await asyncio.to_thread(self._slot.close)

    def forget(self, session: str) -> None:
        """The session's scan is not what it was."""
        self._scans.pop(session, None)

    async def solve(self, session: str, client: str, wanted: PreviewWish) -> Preview:
        """The network with these parameters and marks.

        Raises NotFound, InputError, ScanError, and Conflict when the same client asked for another one meanwhile.
        """
        wish = self._newest[session, client] = object()
        try:
            if stored := await self._of_array(session, wanted.reading):
                work: Callable[[], Awaitable[Preview]] = partial(self._solve_reading, stored, wanted)
            else:
                work = partial(self._solve_scan, await self._scan(session), wanted)
            async with self._turn:
                if self._newest.get((session, client)) is not wish:
                    raise Conflict("the same client asked for another preview meanwhile")
                return await work()
        finally:
            if self._newest.get((session, client)) is wish:
                del self._newest[session, client]

    async def _solve_reading(self, stored: StoredReading, wanted: PreviewWish) -> Preview:
        solved = await self._run(solve_reading, stored.device, stored.reading, wanted)
        return _preview(solved, array_curves(stored.device, solved))

    async def _solve_scan(self, loaded: Loaded, wanted: PreviewWish) -> Preview:
        scan = _marked(loaded.scan, loaded.indices, wanted.marks)
        name = f"{loaded.name} {wanted.marks}"
        solved = await self._run(_solve, name, scan, loaded.indices, wanted, self._budget)
        return _preview(solved, _session_curves(solved, loaded.curves))

    async def reading(self, session: str, number: int) -> LiveReading:
        """The network of a reading as the live view draws it; raises NotFound, InputError and ScanError."""
        stored = await self._of_array(session, number)
        assert stored is not None
        async with self._turn:
            solved = await self._run(draw_reading, stored.device.model_dump_json(), stored.reading)
        return live_reading(stored, solved)

    async def propose(self, session: str) -> NodeProposals:
        """Nodes that were found in a session; raises NotFound and ScanError."""
        loaded = await self._scan(session)
        by_index = {curve.index: curve for curve in loaded.curves}
        async with self._turn:
            return await self._run(propose_nodes, begun_at_nodes(loaded.scan), [by_index[i] for i in loaded.indices])

    async def rawnet(self, session: str) -> str:
        """The session's scan as a rawnet; raises NotFound and ScanError."""
        loaded = await self._scan(session)
        return await asyncio.to_thread(write_rawnet, begun_at_nodes(loaded.scan))

    async def problems(self, session: str) -> NetworkProblems:
        """What keeps a session's curves from becoming a surface; raises NotFound.

        Pages ask when they show curves, so the process is then made ready for the first move of a slider.
        """
        if await self._of_array(session, None):  # what is declared hangs together
            return NetworkProblems(problems=[])
        try:
            loaded = await self._scan(session)
        except ScanError as error:
            return NetworkProblems(problems=[NetworkProblem(message=str(error), severity="error")])
        by_index = {curve.index: curve for curve in loaded.curves}
        async with self._turn:
            found = await self._run(find_problems, loaded.scan, [by_index[i] for i in loaded.indices])
        with suppress(BrokenProcessPool):  # closed meanwhile
            self._slot.prepare(_load_solver)
        return NetworkProblems(problems=found)

    async def _of_array(self, session: str, number: int | None) -> StoredReading | None:
        """The reading that is meant, unless it is the session's scanned curves that are."""
        await self._flush()

        def read() -> StoredReading | None:
            with self._database.read() as transaction:
                meant = is_of_array(transaction, session, number)
                return load_reading(transaction, session, number) if meant else None

        return await asyncio.to_thread(read)

    async def _run(self, function: Callable[..., T], *arguments: object) -> T:
        try:
            return await asyncio.wrap_future(self._slot.submit(function, *arguments))
        except BrokenProcessPool:
            self._slot.renew()
            raise TracemeshError("the process that does it was lost; ask again") from None

    async def _scan(self, session: str) -> Loaded:
        if session not in self._scans:
            self._scans[session] = asyncio.ensure_future(self._load(session))
            while len(self._scans) > MAX_SCANS:
                self._scans.popitem(last=False)
        self._scans.move_to_end(session)
        loading = self._scans[session]
        try:
            return await asyncio.shield(loading)
        except TracemeshError:
            self.forget(session)
            raise

    async def _load(self, session: str) -> Loaded:
        await self._flush()

        def read() -> Loaded:
            with self._database.read() as transaction:
                return Loaded(new_id(), *load_sent(transaction, session), list_curves(transaction, session))

        return await asyncio.to_thread(read)


def _marked(scan: Scan, indices: Sequence[int], wanted: Sequence[CurveMarks]) -> Scan:
    """The scan with other marks on some of its curves; raises InputError where there is no such curve or sample."""
    curves = list(scan.curves)
    for change in wanted:
        if change.curve not in indices:
            raise InputError(f"there is no curve {change.curve} with samples to mark")
        place = indices.index(change.curve)
        count = len(curves[place].distance)
        if beyond := [mark.sample for mark in change.marks if mark.sample >= count]:
            raise InputError(f"curve {change.curve} has {count} samples, got a mark at sample {beyond[0]}")
        curves[place] = with_marks(curves[place], [(mark.sample, mark.node) for mark in change.marks])
    return Scan(tuple(curves))


def _load_solver() -> None:
    """What previews need is loaded while nobody waits for it."""
    import tracemesh.jobs.warm  # noqa: F401


def _solve(name: str, scan: Scan, indices: Sequence[int], wanted: PreviewWish, budget: int) -> SolvedNetwork:
    from tracemesh.jobs.warm import solve_warm  # in the process that solves: the server itself stays small

    return solve_warm(name, scan, indices, wanted, budget)


def _preview(solved: SolvedNetwork | SolvedReading, curves: list[LiveCurve]) -> Preview:
    return Preview(curves=curves, nodes=node_positions(solved), report=solved.report)


def _session_curves(solved: SolvedNetwork, curves: Sequence[Curve]) -> list[LiveCurve]:
    return [
        LiveCurve(
            index=curve.index,
            boundary=curve.boundary,
            closed=curve.closed,
            ended=curve.ended,
            positions=flat(solved.curves[curve.index].positions),
            samples=solved.curves[curve.index].samples.tolist(),
        )
        for curve in curves
        if curve.index in solved.curves
    ]
