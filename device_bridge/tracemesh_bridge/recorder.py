"""Turns readings and the operator's commands into the numbered messages of a recording."""

from dataclasses import dataclass, field
from typing import Any

from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import CurveEnd, CurveStart, NodeMark, Samples
from tracemesh_bridge.errors import OperatorMistake, SpoolError
from tracemesh_bridge.source import Reading
from tracemesh_bridge.spool import Spool

BATCH = 10
"""Samples in one message; `flush` sends fewer when somebody waits for them."""
_COLUMNS = ("time", "received", "ticks", "acceleration", "magnetic", "rotation_rate", "quaternion")


@dataclass
class Progress:
    """Where a recording stands."""

    curve: int = 0
    """Number of the current curve, or of the next one."""
    open: bool = False
    samples: int = 0
    """Samples of the current curve, those not yet in a message included."""
    marks: list[tuple[int, int]] = field(default_factory=list)
    """(sample, node) marked on the current curve and not taken back."""

    def follow(self, message: object) -> None:
        """Take one message of the recording into account."""
        match message:
            case CurveStart(curve=curve):
                self.curve, self.open, self.samples, self.marks = curve, True, 0, []
            case Samples(curve=curve):
                self.curve, self.open, self.samples = curve, True, message.first_sample + message.count
            case NodeMark(curve=curve, sample=sample, node=node, undo=undo):
                self.curve, self.open = curve, True
                if not undo:
                    self.marks.append((sample, node))
                elif (sample, node) in self.marks:
                    self.marks.remove((sample, node))
            case CurveEnd(curve=curve):
                self.curve, self.open, self.samples, self.marks = curve + 1, False, 0, []


class Recorder:
    """One recording, continued where its spool ends, in the middle of a curve too."""

    def __init__(self, spool: Spool) -> None:
        """Goes on where `spool` ends: also with the samples that a killed bridge had only staged."""
        self._spool = spool
        self._batch: list[Reading] = []
        self._at_start: list[int] = []
        self.lost = 0
        """Samples for which there was no room, neither on disk nor in memory."""
        self.progress = Progress()
        for message in spool.tail():
            self.progress.follow(message)
        for samples in list(spool.staged()):
            if self.progress.open and (samples.curve, samples.first_sample) == (
                self.progress.curve,
                self.progress.samples,
            ):
                self._append(samples.model_copy(update={"seq": spool.next_seq}))

    def add(self, reading: Reading | ArrayReading) -> None:
        """Record a sample of the current curve; between curves there is nothing to record. Of an array, any reading."""
        if isinstance(reading, ArrayReading):
            self._add_of_array(reading)
        else:
            self._add_to_curve(reading)

    def _add_of_array(self, reading: ArrayReading) -> None:
        try:
            self._spool.append(reading.model_copy(update={"seq": self._spool.next_seq}))
        except SpoolError:
            self.lost += 1
            raise

    def _add_to_curve(self, reading: Reading) -> None:
        if not self.progress.open:
            return
        if self._batch and _columns(self._batch[0]) != _columns(reading):
            self.flush()
        self._batch.append(reading)
        self._spool.stage(self._samples([reading], self.progress.samples))
        self.progress.samples += 1
        while self._at_start:
            self.mark(self._at_start.pop(0))
        if len(self._batch) >= BATCH:
            self.flush()

    def flush(self) -> None:
        """Put the samples that wait into a message. Raises SpoolError if there is no room for it."""
        if self._batch:
            batch, self._batch = self._batch, []
            try:
                self._append(self._samples(batch, self.progress.samples - len(batch)))
            except SpoolError:
                self.progress.samples -= len(batch)
                self.lost += len(batch)
                raise

    def start(self, boundary: bool) -> str:
        """Begin a curve; returns what to tell the operator. Raises OperatorMistake if one is open."""
        if self._spool.hello.device.array:
            raise OperatorMistake("an array has its curves already, and every reading is recorded: q quits")
        if self.progress.open:
            raise OperatorMistake(f"curve {self.progress.curve} is still open: end it with . (open) or * (closed)")
        self._append(CurveStart(seq=self._spool.next_seq, curve=self.progress.curve, boundary=boundary))
        return f"curve {self.progress.curve} ({'boundary' if boundary else 'interior'}) started"

    def end(self, closed: bool) -> str:
        """End the curve. Raises OperatorMistake if none is open."""
        curve, samples = self._current(), self.progress.samples
        self._at_start.clear()
        self.flush()
        self._append(CurveEnd(seq=self._spool.next_seq, curve=curve, closed=closed))
        return f"curve {curve} ended ({'closed' if closed else 'open'}), {samples} samples"

    def mark(self, node: int) -> str:
        """Mark a node at the newest sample, or at the first one to come. Raises OperatorMistake if no curve is open."""
        curve = self._current()
        if self.progress.samples == 0:
            self._at_start.append(node)
            return f"node {node} at the first sample, once it comes"
        self.flush()
        sample = self.progress.samples - 1
        self._append(NodeMark(seq=self._spool.next_seq, curve=curve, sample=sample, node=node))
        return f"node {node} at sample {sample}"

    def undo(self) -> str:
        """Take back the newest mark. Raises OperatorMistake if the curve has none."""
        curve = self._current()
        if self._at_start:
            return f"took back node {self._at_start.pop()}"
        if not self.progress.marks:
            raise OperatorMistake("no mark to take back on this curve; x throws the whole curve away")
        sample, node = self.progress.marks[-1]
        self._append(NodeMark(seq=self._spool.next_seq, curve=curve, sample=sample, node=node, undo=True))
        return f"took back node {node} at sample {sample}"

    def discard(self) -> str:
        """Throw the current curve away. Raises OperatorMistake if none is open."""
        curve = self._current()
        self._at_start.clear()
        self.flush()
        self._append(CurveEnd(seq=self._spool.next_seq, curve=curve, discard=True))
        return f"curve {curve} thrown away"

    def _current(self) -> int:
        if not self.progress.open:
            raise OperatorMistake("no curve is open: start one with - (boundary) or + (interior)")
        return self.progress.curve

    def _append(self, message: CurveStart | Samples | NodeMark | CurveEnd) -> None:
        self._spool.append(message)
        self.progress.follow(message)

    def _samples(self, batch: list[Reading], first: int) -> Samples:
        columns: dict[str, Any] = {name: [getattr(r, name) for r in batch] for name in _columns(batch[0])}
        return Samples(seq=self._spool.next_seq, curve=self.progress.curve, first_sample=first, **columns)


def _columns(reading: Reading) -> list[str]:
    return [name for name in _COLUMNS if getattr(reading, name) is not None]
