"""Where an open curve ends on curves that are placed already.

The way from its first to its last point and the normals at both must be those between two points of the placed curves:
seven equations for two unknowns. All pairs of points are tried; the heading error of the curve, which moves everything
at once, is part of the covariance and so costs no unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.nodes.contacts import DRIFT, HEADING, NORMAL, POSITION
from tracemesh.geometry.nodes.floating import FloatingCurve, Pose

_FREEDOM = 5
"""Nine equations, of which the two unit normals make seven, less two unknowns."""
_NEAR = 0.06
"""m; pairs of places whose ends are nearer than this are one candidate, not two."""
_PLAUSIBLE = float(chdtri(_FREEDOM, 1e-4))
"""Sum of squares that chance exceeds once in 10,000 times."""


@dataclass(frozen=True)
class Places:
    """Tables of all placed curves, one after the other: points, tangents, normals (k, 3), curve and arc length (k,)."""

    points: Floats
    tangents: Floats
    normals: Floats
    curve: Ints
    arc: Floats


@dataclass(frozen=True)
class Attachment:
    """Rows of the places on which a curve's first and last point lie, and its pose there.

    evidence: logarithm of the odds against ends anywhere. confidence: against all other pairs of places, 0 to 1.
    """

    first: int
    last: int
    pose: Pose
    evidence: float
    confidence: float


def table_of(curves: Sequence[FloatingCurve], poses: dict[int, Pose]) -> Places:
    """The tables of the curves that have a pose."""
    return Places(
        np.concatenate([pose.points(curves[i]) for i, pose in poses.items()]),
        np.concatenate([curves[i].position(curves[i].arc, 1) @ pose.rotation.T for i, pose in poses.items()]),
        np.concatenate([pose.normals(curves[i]) for i, pose in poses.items()]),
        np.concatenate([np.full(len(curves[i].arc), i) for i in poses]),
        np.concatenate([curves[i].arc for i in poses]),
    )


def attach(curve: FloatingCurve, places: Places) -> Attachment | None:
    """The best pair of places for the ends of an open curve; None when none is plausible."""
    whitening, wanted, by_heading = _statistics(curve)
    to_points, to_first, to_last = whitening[:, :3], whitening[:, 3:6], whitening[:, 6:]
    start = places.normals @ to_first.T - places.points @ to_points.T - whitening @ wanted
    end = places.normals @ to_last.T + places.points @ to_points.T
    cost = np.sum(start**2, axis=1)[:, None] + np.sum(end**2, axis=1) + 2 * start @ end.T
    first, last = (int(i) for i in np.unravel_index(cost.argmin(), cost.shape))
    least = float(cost[first, last])
    if least > _PLAUSIBLE:
        return None
    near = np.ix_(*(np.linalg.norm(places.points - places.points[i], axis=1) < _NEAR for i in (first, last)))
    likelihood = np.exp(-(cost - least) / 2)
    confidence = float(likelihood[near].sum() / likelihood.sum())
    pose = _pose(curve, places, first, last, whitening, wanted, by_heading)
    return Attachment(first, last, pose, (_PLAUSIBLE - least) / 2, confidence)


def _statistics(curve: FloatingCurve) -> tuple[Floats, Floats, Floats]:
    """Whitening (9, 9), values (9,) of the way and both normals, and their change (9,) per rad of heading."""
    way, first, last = curve.points[-1] - curve.points[0], curve.normals[0], curve.normals[-1]
    by_heading = np.concatenate([np.cross([0.0, 0.0, 1.0], v) for v in (way, first, last)])
    spread = np.repeat([POSITION + DRIFT * curve.length, NORMAL, NORMAL], 3)
    covariance = np.diag(spread**2) + HEADING**2 * np.outer(by_heading, by_heading)
    return np.linalg.inv(np.linalg.cholesky(covariance)), np.concatenate([way, first, last]), by_heading


def _pose(
    curve: FloatingCurve, places: Places, first: int, last: int, whitening: Floats, wanted: Floats, by_heading: Floats
) -> Pose:
    """The expected heading error given the misfit, and the shift that then suits both ends."""
    found = np.concatenate([places.points[last] - places.points[first], places.normals[first], places.normals[last]])
    turn = HEADING**2 * float((whitening @ by_heading) @ (whitening @ (found - wanted)))
    moved = Pose(turn, np.zeros(3)).points(curve)
    shift = (places.points[first] + places.points[last] - moved[0] - moved[-1]) / 2
    return Pose(turn, shift)
