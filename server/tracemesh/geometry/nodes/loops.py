"""Where a closed curve lies that touches the placed curves only in its course, or only by way of open curves.

Every pair of points that could be a crossing (normals alike, directions not) votes for the shift that makes it one; so
does every way in which an open curve could lead from a placed curve to the loop. Shifts with votes from many different
parts are tried in earnest, and the one that explains most is taken.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.nodes.attachment import Places, attach, table_of
from tracemesh.geometry.nodes.contacts import NORMAL, Contact, settle
from tracemesh.geometry.nodes.crossings import LEAST_ANGLE, Crossing, crossing_odds, find_crossings
from tracemesh.geometry.nodes.floating import FloatingCurve, Pose

_STRIDE = 3
"""Table rows from one tried point to the next."""
_TILT = 3 * NORMAL
_SPREAD = 0.015
"""m, standard deviation of the shifts that crossings of one placed loop vote for."""
_PART = 0.06
"""m, length of the parts of a loop that count as one voter."""
_QUERIES = 3000
_CANDIDATES = 12
_FINALISTS = 3
_LEAST = 3.0
"""Natural logarithm of the odds that a loop's place must have at least."""


@dataclass(frozen=True)
class PlacedLoop:
    """The pose of a loop, the logarithm of the odds for it, and how sure it is against the next best place (0 to 1)."""

    pose: Pose
    evidence: float
    confidence: float


@dataclass(frozen=True)
class _Votes:
    """shift: (v, 3) m; weight: (v,) up to 1; voter: (v,) number of the part of a curve that votes."""

    shift: Floats
    weight: Floats
    voter: Ints


def place_loop(
    index: int, curves: Sequence[FloatingCurve], poses: dict[int, Pose], contacts: Sequence[Contact]
) -> PlacedLoop | None:
    """Best place of a closed curve among those that have a pose and touch in these contacts, and among loose open ones.

    None when no place is convincing.
    """
    loop = curves[index]
    loose = [c for i, c in enumerate(curves) if not c.closed and i not in poses]
    places = table_of(curves, poses)
    parts = int(loop.length / _PART) + 1
    votes = [_crossing_votes(loop, places)]
    votes += [_link_votes(loop, places, curve, parts + k) for k, curve in enumerate(loose)]
    tried = [(_evidence(index, {**poses, index: pose}, curves), pose) for pose in _peaks(_joined(votes))]
    tried.sort(key=lambda t: -t[0])
    settled = [_settled(index, {**poses, index: pose}, curves, contacts) for _, pose in tried[:_FINALISTS]]
    settled.sort(key=lambda t: -t[0])
    if not settled or settled[0][0] < _LEAST:
        return None
    evidence, pose = settled[0]
    elsewhere = [e for e, p in settled if np.linalg.norm(p.shift - pose.shift) > 3 * _SPREAD]
    return PlacedLoop(pose, evidence, float(1 / (1 + np.exp(max(elsewhere, default=0.0) - evidence))))


def _crossing_votes(loop: FloatingCurve, places: Places) -> _Votes:
    rows, others = slice(None, None, _STRIDE), slice(None, None, _STRIDE)
    normals, tangents = loop.normals[rows], loop.position(loop.arc[rows], 1)
    tilt = np.linalg.norm(normals[:, None] - places.normals[others], axis=2)
    along = np.abs(tangents @ places.tangents[others].T)
    i, j = np.nonzero((tilt < _TILT) & (along < np.cos(LEAST_ANGLE)))
    shift = places.points[others][j] - loop.points[rows][i]
    weight = np.exp(-((tilt[i, j] / NORMAL) ** 2) / 4)
    return _Votes(shift, weight, (loop.arc[rows][i] / _PART).astype(np.int64))


def _link_votes(loop: FloatingCurve, places: Places, link: FloatingCurve, voter: int) -> _Votes:
    """An open curve that leads from a placed curve to the loop, in either direction."""
    shifts, weights = [], []
    for here, there in ((0, -1), (-1, 0)):
        tilt_here = np.linalg.norm(places.normals[::_STRIDE] - link.normals[here], axis=1)
        tilt_there = np.linalg.norm(loop.normals[::_STRIDE] - link.normals[there], axis=1)
        i, j = np.flatnonzero(tilt_here < _TILT), np.flatnonzero(tilt_there < _TILT)
        way = link.points[there] - link.points[here]
        pairs = (places.points[::_STRIDE][i] + way)[:, None] - loop.points[::_STRIDE][j]
        cost = (tilt_here[i] ** 2)[:, None] + tilt_there[j] ** 2
        shifts.append(pairs.reshape(-1, 3))
        weights.append(np.exp(-cost.ravel() / (4 * NORMAL**2)))
    shift = np.concatenate(shifts)
    return _Votes(shift, np.concatenate(weights), np.full(len(shift), voter))


def _joined(votes: Sequence[_Votes]) -> _Votes:
    return _Votes(*(np.concatenate([getattr(v, name) for v in votes]) for name in ("shift", "weight", "voter")))


def _peaks(votes: _Votes) -> Iterator[Pose]:
    """Shifts with the most different voters around them, the best first, each far from those before."""
    if not len(votes.shift):
        return
    tree = KDTree(votes.shift)
    queries = votes.shift[np.argsort(-votes.weight)[:: -(-len(votes.shift) // _QUERIES)]]
    scores, centres = np.empty(len(queries)), np.empty((len(queries), 3))
    for k, near in enumerate(tree.query_ball_point(queries, 3 * _SPREAD)):
        pull = votes.weight[near] * np.exp(-np.sum((votes.shift[near] - queries[k]) ** 2, axis=1) / (2 * _SPREAD**2))
        best = np.zeros(votes.voter.max() + 1)
        np.maximum.at(best, votes.voter[near], pull)
        scores[k] = best.sum()
        centres[k] = pull @ votes.shift[near] / pull.sum()
    for _ in range(_CANDIDATES):
        top = int(scores.argmax())
        if scores[top] <= 0:
            return
        yield Pose(0.0, centres[top])
        scores[np.linalg.norm(centres - centres[top], axis=1) < 3 * _SPREAD] = 0


def _evidence(index: int, poses: dict[int, Pose], curves: Sequence[FloatingCurve]) -> float:
    """Logarithm of the odds of a loop's place: by the crossings that it makes and the open curves that it ends."""
    total = sum(float(np.log1p(crossing_odds(c))) for _, c in _crossings(index, poses, curves))
    places = table_of(curves, poses)
    for link in (c for i, c in enumerate(curves) if not c.closed and i not in poses):
        found = attach(link, places)
        if found is not None and index in (places.curve[found.first], places.curve[found.last]):
            total += found.evidence
    return total


def _crossings(index: int, poses: dict[int, Pose], curves: Sequence[FloatingCurve]) -> Iterator[tuple[int, Crossing]]:
    for other in poses:
        if other != index:
            for found in find_crossings(curves[index], poses[index], curves[other], poses[other]):
                yield other, found


def _settled(
    index: int, poses: dict[int, Pose], curves: Sequence[FloatingCurve], contacts: Sequence[Contact]
) -> tuple[float, Pose]:
    """Evidence for a place, and the place, after everything was moved to suit the crossings there."""
    added = [Contact(index, c.s, other, c.t, 1.0) for other, c in _crossings(index, poses, curves)]
    if not added:
        return _evidence(index, poses, curves), poses[index]
    settled = settle(curves, poses, [*contacts, *added])
    strain = float(settled.misfit.sum()) / 2
    return _evidence(index, settled.poses, curves) - strain, settled.poses[index]
