"""A session as drawn: takes what was accepted, says what changed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from tracemesh.api.live.drawing import CurveDrawing, flat
from tracemesh.geometry.scan import Floats
from tracemesh.jobs.attached import SolvedNetwork
from tracemesh.storage.curves import curve_rows, marks_of
from tracemesh.storage.devices import corrected_hello
from tracemesh.storage.models import RecordingRow
from tracemesh.storage.scans import sample_blocks
from tracemesh.wire.device import CurveEnd, CurveStart, Device, NodeMark, OfCurve, Samples
from tracemesh.wire.live import LiveCurve, LiveCurveEnd, LiveCurveStart, LiveNetwork, LiveNode, LivePoints
from tracemesh.wire.resources import NodePosition

Change = LiveCurveStart | LivePoints | LiveNode | LiveCurveEnd | LiveNetwork


@dataclass(frozen=True)
class Accepted:
    """A message of recording `key`, about curve `index` of the session."""

    key: int
    device: Device
    index: int
    message: OfCurve


class SessionTracker:
    """Curves and nodes of one session, positions in m."""

    def __init__(self) -> None:
        """An empty session."""
        self._curves: dict[int, CurveDrawing] = {}
        self._nodes: dict[int, Floats] = {}
        self._next_seq: dict[int, int] = {}

    def take(self, accepted: Iterable[Accepted]) -> list[Change]:
        """What these messages change; those that were taken before change nothing."""
        fresh = [a for a in accepted if self._is_fresh(a)]
        changes: list[Change] = []
        for (index, is_samples), run in groupby(fresh, lambda a: (a.index, isinstance(a.message, Samples))):
            if is_samples:
                changes += self._points(index, [a.message for a in run if isinstance(a.message, Samples)])
            else:
                changes += [change for a in run for change in self._event(a)]
        return changes

    def next_seq(self, key: int) -> int:
        """Number of the first message of a recording that was not taken yet."""
        return self._next_seq.get(key, 0)

    def passed(self, key: int, seq: int) -> None:
        """A message was taken care of that draws no curve."""
        self._next_seq[key] = max(self.next_seq(key), seq + 1)

    def settle(self, solved: SolvedNetwork) -> LiveNetwork:
        """Draw what was solved as solved, the rest from there on."""
        self._nodes.update(solved.nodes)
        for index, curve in solved.curves.items():
            if index in self._curves:
                self._curves[index].settle(curve.positions, curve.samples, curve.last_sample)
        return self.network()

    def network(self) -> LiveNetwork:
        """Everything as drawn now."""
        return LiveNetwork(
            curves=[_curve(index, drawing) for index, drawing in sorted(self._curves.items())],
            nodes=[_node(number, position) for number, position in sorted(self._nodes.items())],
        )

    def _is_fresh(self, accepted: Accepted) -> bool:
        expected = self._next_seq.get(accepted.key, 0)
        self._next_seq[accepted.key] = max(expected, accepted.message.seq + 1)
        return accepted.message.seq >= expected

    def _points(self, index: int, blocks: Sequence[Samples]) -> list[Change]:
        if index not in self._curves:  # removed meanwhile
            return []
        first, positions, samples = self._curves[index].extend(blocks)
        points = LivePoints(index=index, first=first, positions=flat(positions), samples=samples.tolist())
        return [points] if len(positions) else []

    def _event(self, accepted: Accepted) -> list[Change]:
        index, message = accepted.index, accepted.message
        if isinstance(message, CurveStart):
            self._curves[index] = CurveDrawing(accepted.device, message.boundary)
            return [LiveCurveStart(index=index, boundary=message.boundary)]
        if index not in self._curves:
            return []
        if isinstance(message, NodeMark):
            return self._mark(index, message.sample, message.node, message.undo)
        assert isinstance(message, CurveEnd)
        return self._end(index, message)

    def _end(self, index: int, message: CurveEnd) -> list[Change]:
        if message.discard:
            del self._curves[index]
            return [self.network()]
        self._curves[index].ended = True
        self._curves[index].closed = message.closed
        return [LiveCurveEnd(index=index, closed=message.closed)]

    def _mark(self, index: int, sample: int, node: int, undo: bool = False) -> list[Change]:
        """A known node puts a loose curve in its place; an unknown one is where the curve is."""
        curve = self._curves[index]
        if undo:
            self._nodes.pop(node, None)
            return [self.network()]
        if node in self._nodes and not curve.attached:
            curve.attach(sample, self._nodes[node])
            return [LiveNode(index=index, node=_node(node, self._nodes[node])), self.network()]
        if node not in self._nodes:
            self._nodes[node] = curve.position(sample)
            curve.attached = True
        return [LiveNode(index=index, node=_node(node, self._nodes[node]))]

    @staticmethod
    def load(transaction: Transaction, session: str) -> "SessionTracker":
        """A session as stored and edited."""
        tracker = SessionTracker()
        recordings = transaction.scalars(select(RecordingRow).where(RecordingRow.session_id == session)).all()
        tracker._next_seq = {row.key: row.next_seq for row in recordings}
        devices = {row.key: corrected_hello(transaction, row).device for row in recordings}
        blocks = {key: sample_blocks(transaction, key) for key, device in devices.items() if device.array is None}
        for row in curve_rows(transaction, session):
            drawing = CurveDrawing(devices[row.recording_key], row.boundary)
            drawing.closed, drawing.ended = row.closed, row.ended
            tracker._curves[row.index] = drawing
            if own := blocks[row.recording_key][row.number]:
                drawing.extend(own)
            for mark in marks_of(transaction, row):
                tracker._mark(row.index, mark.sample, mark.node)
        return tracker


def _curve(index: int, drawing: CurveDrawing) -> LiveCurve:
    return LiveCurve(
        index=index,
        boundary=drawing.boundary,
        closed=drawing.closed,
        ended=drawing.ended,
        positions=flat(drawing.positions),
        samples=drawing.samples.tolist(),
    )


def _node(number: int, position: Floats) -> NodePosition:
    x, y, z = (float(v) for v in position)
    return NodePosition(node=number, position=(x, y, z))
