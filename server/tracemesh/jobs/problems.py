"""What keeps a session's curves from becoming a surface: where it is, and the edit that would mend it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.scan import Floats, Scan, curve_name
from tracemesh.jobs.attached import SolvedNetwork, solve_network
from tracemesh.jobs.numbering import renumbered
from tracemesh.wire.resources import Curve, CurveEdit, CurveUpdate, Fix, Mark, NetworkProblem

if TYPE_CHECKING:
    from tracemesh.geometry.surfaces.cell_complex import Fault

NEAR = 0.05
"""Part of the network's diagonal within which a loose end is taken to have meant another curve."""
CHANGES = {
    "boundary": ("Mark curve {} as boundary", CurveUpdate(boundary=True)),
    "interior": ("Mark curve {} as interior", CurveUpdate(boundary=False)),
    "open": ("Mark curve {} as open", CurveUpdate(closed=False)),
    "remove": ("Remove curve {}", CurveUpdate(removed=True)),
}


def find_problems(scan: Scan, curves: Sequence[Curve]) -> list[NetworkProblem]:
    """Problems of a scan, as it was sent, whose curves are these of a session; errors first."""
    try:
        solved = solve_network(scan, [curve.index for curve in curves])
    except ScanError as error:
        return [_of_error(error, curves)]
    found = _Finder(solved, curves)
    return [*found.problems(), *found.warnings()]


def _of_error(error: ScanError, curves: Sequence[Curve]) -> NetworkProblem:
    indices = [curves[k].index for k in error.curves]
    fix = None
    if error.mend == "nodes":
        fix = Fix(label="Find where curves meet")
    elif error.mend is not None and indices:
        doubtful = error.mend == "remove" and curves[error.curves[0]].closed  # less is lost by opening it
        fix = _change("open" if doubtful else error.mend, indices[0])
    return NetworkProblem(message=str(error), severity="error", curves=indices, fix=fix)


def _change(mend: str, curve: int) -> Fix:
    label, change = CHANGES[mend]
    return Fix(label=label.format(curve + 1), changes=[CurveEdit(curve=curve, change=change)])


@dataclass(frozen=True)
class _Place:
    """A sample of a curve and how far it is, m."""

    curve: int
    sample: int
    away: float


class _Finder:
    """Faults of a solved network in the words and numbers of its session."""

    def __init__(self, solved: SolvedNetwork, curves: Sequence[Curve]) -> None:
        self._solved, self._curves = solved, curves
        self._network = solved.network

    def problems(self) -> Iterator[NetworkProblem]:
        from tracemesh.geometry.surfaces.cell_complex import find_faults

        faults = find_faults(self._network)
        for fault in faults:
            curve = self._curve(fault.segment)
            first, last = self._samples(fault.segment)
            ends = {None: (first, last), 0: (first, first), -1: (last, last)}[fault.end]
            fix = self._fix(fault, faults, curve, ends[0])
            message = renumbered(fault.message, [c.index for c in self._curves])
            yield NetworkProblem(message=message, severity="error", curves=[curve.index], samples=ends, fix=fix)

    def warnings(self) -> Iterator[NetworkProblem]:
        for misfit in self._solved.misfits:
            curve, ends = self._curve(misfit.segment), self._samples(misfit.segment)
            message = misfit.warning(curve_name(curve.index))
            yield NetworkProblem(message=message, severity="warning", curves=[curve.index], samples=ends)

    def _fix(self, fault: "Fault", faults: "Sequence[Fault]", curve: Curve, sample: int) -> Fix | None:
        if fault.end is not None:
            return self._joined(fault, curve, sample) or _change("remove", curve.index)
        own = [i for i, s in enumerate(self._network.segments) if self._curve(i) is curve]
        alike = {f.segment for f in faults if f.mend == fault.mend}
        # The tag is the curve's: it mends a segment only if it is right for all the others too.
        return _change(fault.mend, curve.index) if fault.mend and alike.issuperset(own) else None

    def _joined(self, fault: "Fault", curve: Curve, sample: int) -> Fix | None:
        """A loose end's node marked on the curve that passes close by."""
        segment = self._network.segments[fault.segment]
        point = int(segment.points[fault.end or 0])
        place = self._nearest(self._network.points[point], curve.index)
        if place is None or place.away > NEAR * self._network.diagonal:
            return None
        other = next(c for c in self._curves if c.index == place.curve)
        fresh = max((m.node for c in self._curves for m in c.marks), default=-1) + 1
        here = next((m.node for m in curve.marks if m.sample == sample), fresh)
        there = next((m.node for m in other.marks if m.sample == place.sample), None)
        node = here if there is None else there
        marks = {(m.sample, node if m.node == here else m.node) for m in curve.marks} | {(sample, node)}
        changes = [
            _marked(curve, marks),
            _marked(other, {(m.sample, m.node) for m in other.marks} | {(place.sample, node)}),
        ]
        return Fix(label=f"Join it to curve {place.curve + 1}, {1e3 * place.away:.0f} mm away", changes=changes)

    def _nearest(self, position: Floats, but: int) -> _Place | None:
        places = []
        for index, curve in self._solved.curves.items():
            if index != but:
                away = np.linalg.norm(curve.positions - position, axis=1)
                places.append(_Place(index, int(curve.samples[away.argmin()]), float(away.min())))
        return min(places, key=lambda place: place.away, default=None)

    def _curve(self, segment: int) -> Curve:
        return self._curves[self._network.segments[segment].curve]

    def _samples(self, segment: int) -> tuple[int, int]:
        """First and last sample of a segment, as sent."""
        curve = self._network.segments[segment].curve
        own = [i for i, s in enumerate(self._network.segments) if s.curve == curve]
        before = sum(len(self._network.segments[i].points) - 1 for i in own if i < segment)
        samples = self._solved.curves[self._curves[curve].index].samples
        return int(samples[before]), int(samples[before + len(self._network.segments[segment].points) - 1])


def _marked(curve: Curve, marks: set[tuple[int, int]]) -> CurveEdit:
    listed = [Mark(sample=sample, node=node) for sample, node in sorted(marks)]
    return CurveEdit(curve=curve.index, change=CurveUpdate(marks=listed))
