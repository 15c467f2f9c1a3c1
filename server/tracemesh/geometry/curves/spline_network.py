"""Cubic splines through a network of unevenly spaced points, with tangent planes shared at nodes (thesis, appendix C).

The splines minimise the sum over curves of the integral of |x''|^2 over chord length, as minimum norm networks do, with
tangents at nodes orthogonal to the given normals. A curve goes smoothly through the nodes on it; the thesis instead
spaces the tangents of all segments at a node evenly, which no real network does. With the normals given, one sparse
system in the derivatives at all points is all there is to solve. Normals follow a spline of their own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, coo_array, csc_array, kron
from scipy.sparse.linalg import splu

from tracemesh.errors import NetworkError
from tracemesh.geometry.curves.misclosure import tangent_bases
from tracemesh.geometry.network import CurveNetwork, Floats, Ints, Segment
from tracemesh.geometry.rotations import normalized

_PARTS = 16  # of an interval, between which arc length is interpolated
_MOST_POINTS = 5e6
_SAME_WAY = 0.5  # cosine between end and start of a closed curve that goes smoothly through its start


@dataclass(frozen=True)
class _Intervals:
    """Pieces between neighbouring points: point and knot at either end (i,), chord length (i,), m, segment (i,).

    A knot is a point as one curve passes it; knots: point (k,) of each.
    """

    points: NDArray[np.int64]
    knots: NDArray[np.int64]
    chord: Floats
    segment: Ints
    knot_point: Ints


def _continues(network: CurveNetwork, before: Segment, after: Segment) -> bool:
    """Whether a curve goes on smoothly from one segment to another."""
    if before.curve != after.curve or before.points[-1] != after.points[0]:
        return False
    x = network.points
    way = [normalized(x[s.points[i + 1]] - x[s.points[i]]) for s, i in ((before, len(before.points) - 2), (after, 0))]
    return float(way[0] @ way[1]) > _SAME_WAY


def _knots(network: CurveNetwork) -> tuple[list[Ints], Ints]:
    """Knot of every point of every segment, and the point of every knot."""
    own: list[Ints] = []
    points: list[int] = []
    for segment in network.segments:
        own.append(len(points) + np.arange(len(segment.points)))
        points.extend(segment.points.tolist())
    same = np.arange(len(points))
    for i, segment in enumerate(network.segments):
        for j in (i + 1, i):  # the next segment of the curve, or its own start
            if j < len(own) and _continues(network, segment, network.segments[j]):
                same[own[i][-1]] = own[j][0]
                break
        else:
            first = next(k for k, s in enumerate(network.segments) if s.curve == segment.curve)
            if _continues(network, segment, network.segments[first]):
                same[own[i][-1]] = own[first][0]
    used, index = np.unique(same, return_inverse=True)
    return [index[k] for k in own], np.array(points)[used]


def _intervals(network: CurveNetwork) -> _Intervals:
    knots, knot_point = _knots(network)
    points = np.concatenate([np.stack([s.points[:-1], s.points[1:]], axis=1) for s in network.segments])
    pairs = np.concatenate([np.stack([k[:-1], k[1:]], axis=1) for k in knots])
    segment = np.repeat(np.arange(len(knots)), [len(k) - 1 for k in knots])
    chord = np.linalg.norm(network.points[points[:, 1]] - network.points[points[:, 0]], axis=1)
    if not (chord > 0).all():
        bad = network.segments[segment[int((~(chord > 0)).argmax())]]
        raise NetworkError(
            f"two neighbouring points of the segment from point {bad.points[0]} to {bad.points[-1]} are one"
        )
    return _Intervals(points, pairs, chord, segment, knot_point)


def _derivatives(intervals: _Intervals, values: Floats, allowed: csc_array | None) -> Floats:
    """Derivatives (k, 3) at knots of the cubic splines through values (p, 3) with the least integral of |x''|^2.

    Over an interval that is 4/h (T_0^2 + T_0 T_1 + T_1^2) - 12/h^2 (x_1 - x_0)(T_0 + T_1) + a constant. allowed: maps
    the free components to the derivatives (3k,).
    """
    count, (a, b), h = len(intervals.knot_point), intervals.knots.T, intervals.chord
    entries = np.concatenate([2 / h, 2 / h, 1 / h, 1 / h])
    places = (np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a]))
    matrix = coo_array((entries, places), shape=(count, count))
    slope = 3 * (values[intervals.points[:, 1]] - values[intervals.points[:, 0]]) / h[:, None] ** 2
    right = np.zeros((count, 3))
    np.add.at(right, a, slope)
    np.add.at(right, b, slope)
    if allowed is None:
        return np.asarray(splu(matrix.tocsc()).solve(right))
    full = kron(matrix, np.eye(3), format="csc")
    free = splu((allowed.T @ full @ allowed).tocsc()).solve(allowed.T @ right.ravel())
    return np.asarray(allowed @ free).reshape(-1, 3)


def _in_tangent_planes(network: CurveNetwork, knot_point: Ints) -> csc_array:
    """Map (3k, f) from free components to derivatives that are orthogonal to the normals at nodes."""
    at_node = np.isin(knot_point, network.nodes)
    bases = tangent_bases(network.normals[knot_point])
    blocks = [bases[k].T if at_node[k] else np.eye(3) for k in range(len(knot_point))]
    return csc_array(block_diag(blocks))


def _hermite(u: Floats, h: Floats, x: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Values and derivatives (n, 3) at shares u (n,) of intervals of length h (n,), with ends x, t (2, n, 3)."""
    u, h = u[:, None], h[:, None]
    value = (1 + 2 * u) * (1 - u) ** 2 * x[0] + u**2 * (3 - 2 * u) * x[1]
    value += h * (u * (1 - u) ** 2 * t[0] - u**2 * (1 - u) * t[1])
    slope = 6 * u * (1 - u) * (x[1] - x[0]) / h + (1 - u) * (1 - 3 * u) * t[0] + u * (3 * u - 2) * t[1]
    return value, slope


class _SplineNetwork:
    """The splines of points and normals, evaluated at shares of intervals."""

    def __init__(self, network: CurveNetwork) -> None:
        self._network, self.intervals = network, _intervals(network)
        allowed = _in_tangent_planes(network, self.intervals.knot_point)
        self._tangents = _derivatives(self.intervals, network.points, allowed)
        self._turns = _derivatives(self.intervals, network.normals, None)

    def at(self, interval: Ints, share: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, derivatives by chord length, and unit normals orthogonal to these (n, 3)."""
        pieces = self.intervals
        ends, knots, h = pieces.points[interval].T, pieces.knots[interval].T, pieces.chord[interval]
        points, slope = _hermite(share, h, self._network.points[ends], self._tangents[knots])
        normals, _ = _hermite(share, h, self._network.normals[ends], self._turns[knots])
        along = normalized(slope)
        return points, slope, normalized(normals - np.sum(normals * along, axis=1, keepdims=True) * along)

    def spread(self, segment: int, step: float) -> tuple[Ints, Floats]:
        """Intervals and shares (n,) of points at even distances of about `step` m inside a segment."""
        own = np.flatnonzero(self.intervals.segment == segment)
        interval = np.repeat(own, _PARTS)
        share = np.tile((np.arange(_PARTS) + 0.5) / _PARTS, len(own))
        speed = np.linalg.norm(self.at(interval, share)[1], axis=1)
        arc = np.concatenate([[0.0], np.cumsum(speed * self.intervals.chord[interval] / _PARTS)])
        points = self._network.segments[segment].points
        count = max(int(np.rint(arc[-1] / step)), 3 if points[0] == points[-1] else 1)
        place = np.interp(np.arange(1, count) * arc[-1] / count, arc, np.arange(len(arc)) / _PARTS)
        index = np.minimum(place.astype(np.int64), len(own) - 1)
        return own[index], place - index


def _check_step(network: CurveNetwork, step: float) -> None:
    if not (np.isfinite(step) and step > 0):
        raise NetworkError(f"wanted a positive number of metres between points, got {step:g}")
    length = sum(
        float(np.linalg.norm(np.diff(network.points[s.points], axis=0), axis=1).sum()) for s in network.segments
    )
    if length / step > _MOST_POINTS:
        raise NetworkError(
            f"a step of {step:.3g} m asks for more than {_MOST_POINTS:.0e} points on {length:.3g} m of curves"
        )


def resample_network(network: CurveNetwork, step: float) -> CurveNetwork:
    """The network on its splines, every segment evenly spaced by about `step` m; ends of segments stay what they are.

    Raises NetworkError where two neighbouring points are one, and for a step that is no length or asks for too much.
    """
    _check_step(network, step)
    splines = _SplineNetwork(network)
    kept, index = np.unique([p for s in network.segments for p in (s.points[0], s.points[-1])], return_inverse=True)
    points, normals, segments, count = [network.points[kept]], [network.normals[kept]], [], len(kept)
    for i, segment in enumerate(network.segments):
        inner, _, across = splines.at(*splines.spread(i, step))
        new = np.concatenate([index[2 * i : 2 * i + 1], count + np.arange(len(inner)), index[2 * i + 1 : 2 * i + 2]])
        points.append(inner)
        normals.append(across)
        segments.append(Segment(new, segment.boundary, segment.curve))
        count += len(inner)
    nodes = np.searchsorted(kept, network.nodes)
    return CurveNetwork(np.concatenate(points), np.concatenate(normals), nodes, tuple(segments))
