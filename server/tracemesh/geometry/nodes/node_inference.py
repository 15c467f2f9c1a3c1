"""Nodes of a scan in which they were not marked, with a confidence for each (the thesis's open problem).

Curves are placed one after the other, beginning with a closed one or with those that marked nodes hold together: open
curves by their ends, closed ones by votes. Then curves cross where they come near each other with the same normal, and
one joint solution corrects all places.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import erf

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.closed_curves import from_first_node
from tracemesh.geometry.nodes.attachment import attach, table_of
from tracemesh.geometry.nodes.contacts import Contact, settle
from tracemesh.geometry.nodes.crossings import crossing_odds, find_crossings
from tracemesh.geometry.nodes.floating import FloatingCurve, Pose, float_curves
from tracemesh.geometry.nodes.loops import place_loop
from tracemesh.geometry.scan import CurveScan, Scan

_SURE = 0.95
_LIKELY = 0.3
_APART = 0.03
"""m along both curves; nearer crossings of the same two curves are one."""
_MARKED = 0.02
"""m along a curve from a contact to a mark of it."""
_SAME = 0.005
"""m along a curve; contacts nearer than this cannot be told apart: one node."""
_ROUNDS = 2


@dataclass(frozen=True)
class NodeProposal:
    """One node. places: (curve, sample) on each of its curves, both counted from 0.

    confidence: 0 to 1, that it is one, and within 20 mm of these places. node: its number if it was marked
    before, else None.
    """

    places: tuple[tuple[int, int], ...]
    confidence: float
    node: int | None = None


@dataclass(frozen=True)
class InferredNodes:
    """proposals: nodes that were found, those already marked among them. unplaced: curves (from 0) for which no place
    was found, so that nothing is said about their nodes.
    """

    proposals: tuple[NodeProposal, ...]
    unplaced: tuple[int, ...]


def infer_nodes(scan: Scan) -> InferredNodes:
    """Nodes of a scan, marked or not.

    Raises ScanError when a curve cannot be used, or when there is no closed curve and no marked node to begin with.
    """
    curves = float_curves(scan)
    search = _Search(scan, curves)
    while search.attach_open() or search.place_a_loop():
        search.settle_and_cross()
    search.settle_and_cross()
    unplaced = tuple(i for i in range(len(curves)) if i not in search.poses)
    lonely = [NodeProposal(((m.curve, m.sample),), 1.0, m.node) for m in search.lonely]
    found = [*_proposals(scan, curves, search.contacts), *lonely]
    return InferredNodes(tuple(sorted(found, key=lambda p: p.places)), unplaced)


def mark_nodes(scan: Scan, proposals: Sequence[NodeProposal]) -> Scan:
    """The scan with these nodes marked instead of its own; those without a number get the next free ones."""
    free = 1 + max((p.node for p in proposals if p.node is not None), default=-1)
    marks: list[list[tuple[int, int]]] = [[] for _ in scan.curves]
    for proposal in proposals:
        node = proposal.node
        if node is None:
            node, free = free, free + 1
        for curve, sample in proposal.places:
            marks[curve].append((sample, node))
    return Scan(tuple(_marked(curve, sorted(m)) for curve, m in zip(scan.curves, marks, strict=True)))


@dataclass(frozen=True)
class _Mark:
    """A marked node: sample and arc length, m, on a curve."""

    curve: int
    sample: int
    arc: float
    node: int


class _Search:
    """What is placed so far."""

    def __init__(self, scan: Scan, curves: Sequence[FloatingCurve]) -> None:
        self._curves = curves
        marks = _marks(scan, curves)
        self._marked = _marked_contacts(marks)
        paired = {c.node for c in self._marked}
        self.lonely = [m for m in marks if m.node not in paired]
        self.contacts: list[Contact] = []
        start = _start(scan, curves)
        self.poses: dict[int, Pose] = {start: Pose(0.0, np.zeros(3))}
        self._trust = np.ones(len(curves))
        self._follow_marks()

    def _follow_marks(self) -> None:
        """Place what marked nodes hold to placed curves."""
        waiting = [c for c in self._marked if c not in self.contacts]
        while ready := [c for c in waiting if c.a in self.poses or c.b in self.poses]:
            for contact in ready:
                for here, there, s, t in (
                    (contact.a, contact.b, contact.s, contact.t),
                    (contact.b, contact.a, contact.t, contact.s),
                ):
                    if here in self.poses and there not in self.poses:
                        pose = self.poses[here]
                        place = pose.rotation @ self._curves[here].position(s) + pose.shift
                        self.poses[there] = Pose(0.0, place - self._curves[there].position(t))
                self.contacts.append(contact)
            waiting = [c for c in waiting if c not in ready]

    def attach_open(self) -> bool:
        """Attach the open curves whose ends are sure, or else the likeliest; says whether any was placed."""
        places = table_of(self._curves, self.poses)
        loose = [i for i, c in enumerate(self._curves) if not c.closed and i not in self.poses]
        found = [(i, a) for i in loose if (a := attach(self._curves[i], places)) is not None]
        found.sort(key=lambda f: -f[1].confidence)
        chosen = [f for k, f in enumerate(found) if f[1].confidence > (_LIKELY if k == 0 else _SURE)]
        for i, attachment in chosen:
            self.poses[i] = attachment.pose
            ends = places.curve[[attachment.first, attachment.last]]
            self._trust[i] = attachment.confidence * self._trust[ends].min()
            for end, row in ((0.0, attachment.first), (self._curves[i].length, attachment.last)):
                on, at = int(places.curve[row]), float(places.arc[row])
                self._add(Contact(i, end, on, at, float(self._trust[i]), known_s=True))
        self._follow_marks()
        return bool(chosen)

    def place_a_loop(self) -> bool:
        """Place the closed curve with the strongest evidence; says whether there was one."""
        loops = [i for i, c in enumerate(self._curves) if c.closed and i not in self.poses]
        found = [(i, p) for i in loops if (p := place_loop(i, self._curves, self.poses, self.contacts))]
        if not found:
            return False
        index, best = max(found, key=lambda f: f[1].evidence)
        self.poses[index], self._trust[index] = best.pose, best.confidence
        self._follow_marks()
        return True

    def settle_and_cross(self) -> None:
        """Improve all places, find crossings, and improve again."""
        for _ in range(_ROUNDS):
            self._add_crossings()
            if self.contacts:
                between = [c for c in self.contacts if c.a != c.b]
                settled = settle(self._curves, self.poses, between)
                within = [c for c in self.contacts if c.a == c.b]
                self.poses, self.contacts = settled.poses, [*settled.contacts, *within]

    def _add_crossings(self) -> None:
        placed = sorted(self.poses)
        for k, a in enumerate(placed):
            for b in placed[k + 1 :]:
                for found in find_crossings(self._curves[a], self.poses[a], self._curves[b], self.poses[b]):
                    odds = crossing_odds(found)
                    confidence = odds / (1 + odds) * min(self._trust[a], self._trust[b])
                    contact = Contact(a, found.s, b, found.t, float(confidence))
                    if odds > 1 and not any(self._is_same(contact, c) for c in self.contacts):
                        self._add(contact)

    def _add(self, contact: Contact) -> None:
        """Take in a contact; a mark next to it that no other curve shares says where it is, and its number."""
        for mark in list(self.lonely):
            near_s = contact.a == mark.curve and self._is_at(mark, contact.s)
            near_t = contact.b == mark.curve and self._is_at(mark, contact.t)
            if (near_s or near_t) and contact.node in (None, mark.node):
                self.lonely.remove(mark)
                contact = replace(contact, node=mark.node)
                contact = replace(contact, s=mark.arc, known_s=True) if near_s else contact
                contact = replace(contact, t=mark.arc, known_t=True) if near_t else contact
        self.contacts.append(contact)

    def _is_at(self, mark: _Mark, arc: float) -> bool:
        return bool(abs(self._curves[mark.curve].apart(arc, mark.arc)) < _MARKED)

    def _is_same(self, one: Contact, other: Contact) -> bool:
        if (one.a, one.b) == (other.b, other.a):
            other = replace(other, a=other.b, s=other.t, b=other.a, t=other.s)
        near_s = abs(self._curves[one.a].apart(one.s, other.s)) < _APART
        near_t = abs(self._curves[one.b].apart(one.t, other.t)) < _APART
        return (one.a, one.b) == (other.a, other.b) and bool(near_s and near_t)


def _start(scan: Scan, curves: Sequence[FloatingCurve]) -> int:
    """A closed boundary, or any closed curve, or one with marks; the longest of its kind."""
    kinds = (lambda c: c.closed and c.boundary, lambda c: c.closed, lambda c: len(c.node_ids) > 0)
    for kind in kinds:
        fitting = [i for i, c in enumerate(scan.curves) if kind(c)]
        if fitting:
            return max(fitting, key=lambda i: curves[i].length)
    raise ScanError("nodes can only be found beginning with a closed curve or a marked node: the scan has neither")


def _marks(scan: Scan, curves: Sequence[FloatingCurve]) -> list[_Mark]:
    """All marks of a scan."""
    return [
        _Mark(i, int(sample), float(np.clip(scanned.distance[sample] - curve.start, 0.0, curve.length)), int(node))
        for i, (scanned, curve) in enumerate(zip(scan.curves, curves, strict=True))
        for sample, node in zip(scanned.node_samples, scanned.node_ids, strict=True)
    ]


def _marked_contacts(marks: Sequence[_Mark]) -> list[Contact]:
    """Nodes that are marked more than once, each as contacts with the first mark."""
    first: dict[int, _Mark] = {}
    return [
        Contact(f.curve, f.arc, m.curve, m.arc, 1.0, known_s=True, known_t=True, node=m.node)
        for m in marks
        if (f := first.setdefault(m.node, m)) is not m
    ]


def _proposals(scan: Scan, curves: Sequence[FloatingCurve], contacts: Sequence[Contact]) -> list[NodeProposal]:
    """Contacts that share a place on a curve are one node, unless they were marked as different ones."""
    groups: list[list[Contact]] = []
    for contact in sorted(contacts, key=lambda c: c.node is None):
        touching = [g for g in groups if any(_share_a_place(contact, c, curves) for c in g)]
        numbers = {c.node for g in touching for c in g if c.node is not None}
        if len(numbers) > 1 or (contact.node is not None and numbers - {contact.node}):
            touching = [g for g in touching if any(c.node == contact.node for c in g if c.node is not None)]
        groups = [g for g in groups if g not in touching] + [[contact, *(c for g in touching for c in g)]]
    return [_proposal(scan, curves, group) for group in groups]


def _share_a_place(one: Contact, other: Contact, curves: Sequence[FloatingCurve]) -> bool:
    return any(
        i == j and abs(curves[i].apart(s, t)) < _SAME
        for i, s in ((one.a, one.s), (one.b, one.t))
        for j, t in ((other.a, other.s), (other.b, other.t))
    )


def _proposal(scan: Scan, curves: Sequence[FloatingCurve], group: Sequence[Contact]) -> NodeProposal:
    ends = sorted({(i, arc) for c in group for i, arc in ((c.a, c.s), (c.b, c.t))})
    clusters: list[tuple[int, list[float]]] = []
    for i, arc in ends:
        if not clusters or clusters[-1][0] != i or abs(curves[i].apart(arc, clusters[-1][1][0])) > _APART:
            clusters.append((i, []))
        clusters[-1][1].append(arc)
    places = [(i, _sample(scan.curves[i], curves[i], arcs)) for i, arcs in clusters]
    numbers = [c.node for c in group if c.node is not None]
    confidence = min(c.confidence * _share_within(c.spread) for c in group)
    return NodeProposal(tuple(places), confidence, min(numbers, default=None))


def _share_within(spread: float) -> float:
    """Probability that a place with a standard deviation, m, is not further off than a mark is looked for."""
    return erf(_MARKED / (spread * 2**0.5)) if spread else 1.0


def _sample(scanned: CurveScan, curve: FloatingCurve, arcs: Sequence[float]) -> int:
    """The sample nearest to the middle of arc lengths, m, that belong together."""
    middle = arcs[0] + float(np.mean(curve.apart(np.array(arcs), arcs[0])))
    if curve.closed and curve.length - middle < _SAME:  # where it ends is where it begins
        middle = 0.0
    return int(np.abs(scanned.distance - curve.start - middle).argmin())


def _marked(curve: CurveScan, marks: Sequence[tuple[int, int]]) -> CurveScan:
    table = np.array(marks, np.int64).reshape(-1, 2)
    marked = replace(curve, node_samples=table[:, 0].copy(), node_ids=table[:, 1].copy())
    return from_first_node(marked) if curve.closed else marked
