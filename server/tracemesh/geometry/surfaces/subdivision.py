"""A curve network with more points on its segments, for meshes finer than itself or finer in places, or with fewer."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from tracemesh.geometry.network import CurveNetwork, Floats, Ints, Segment
from tracemesh.geometry.surfaces.curvature import normalised

STEEPEST = 4.0  # an edge over the shortest at its ends; with more, no triangles between them have wide angles
_ROUNDS = 6  # each takes the root of what edges are too long by


def subdivided(network: CurveNetwork, spacing: float) -> CurveNetwork:
    """The network with every edge longer than the spacing (m) divided evenly; new points come after the given ones.

    Positions and normals of the new points lie on the cubic spline through their segment's.
    """
    _, lengths = _edges(network)
    parts = np.maximum(np.ceil(lengths / spacing - 1e-6), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(parts)), parts - 1)
    return _inserted(network, edge, np.concatenate([np.arange(1, p) / p for p in parts]))


def graded(network: CurveNetwork) -> CurveNetwork:
    """The network with edges divided that are more than `STEEPEST` times as long as the shortest that they meet.

    Curves that cross in almost one point leave such edges: triangles over them would be slivers, whatever is inside.
    New points come after the given ones, on the splines of `subdivided`; a network without such edges is returned.
    """
    for _ in range(_ROUNDS):
        ends, lengths = _edges(network)
        shortest = np.full(len(network.points), np.inf)
        np.minimum.at(shortest, ends, lengths[:, None])
        beside = shortest[ends]
        long = np.flatnonzero(lengths > STEEPEST * beside.min(1))
        if not len(long):
            break
        share = np.sqrt(beside.min(1)[long] / lengths[long])
        network = _inserted(network, long, np.where(beside.argmin(1)[long] == 0, share, 1 - share))
    return network


def thinned(network: CurveNetwork, every: int) -> CurveNetwork:
    """The network with about every k-th point of its segments, their ends among them; a segment keeps three edges or
    more, a closed one six, if it has them.
    """
    chosen = []
    for segment in network.segments:
        parts = len(segment.points) - 1
        least = 6 if segment.points[0] == segment.points[-1] else 3
        edges = max(round(parts / every), min(parts, least))
        chosen.append(segment.points[np.round(np.linspace(0, parts, edges + 1)).astype(np.int64)])
    kept = np.unique(np.concatenate(chosen))
    number = np.full(len(network.points), -1)
    number[kept] = np.arange(len(kept))
    segments = tuple(replace(s, points=number[c]) for s, c in zip(network.segments, chosen, strict=True))
    return _with_points(network, network.points[kept], network.normals[kept], number[network.nodes], segments)


def _with_points(
    network: CurveNetwork, points: Floats, normals: Floats, nodes: Ints, segments: tuple[Segment, ...]
) -> CurveNetwork:
    """The network with other points (n, 3), the same nodes among them, which keep their numbers."""
    return CurveNetwork(points, normals, nodes, segments, node_numbers=network.node_numbers)


def _edges(network: CurveNetwork) -> tuple[Ints, Floats]:
    """Points (e, 2) and lengths (e,), m, of the edges of all segments."""
    ends = np.concatenate([np.column_stack([s.points[:-1], s.points[1:]]) for s in network.segments])
    return ends, np.linalg.norm(network.points[ends[:, 1]] - network.points[ends[:, 0]], axis=1)


def _inserted(network: CurveNetwork, edge: Ints, share: Floats) -> CurveNetwork:
    """The network with new points at shares (m,) of edges (m,), which are in order."""
    points, normals, segments = [network.points], [network.normals], []
    count, first = len(network.points), 0
    for segment in network.segments:
        last = first + len(segment.points) - 1
        own = slice(*np.searchsorted(edge, [first, last]))
        between, facing = _on_spline(network, segment, edge[own] - first, share[own])
        new = count + np.arange(len(between))
        segments.append(replace(segment, points=np.insert(segment.points, 1 + edge[own] - first, new)))
        points.append(between)
        normals.append(facing)
        count, first = count + len(between), last
    return _with_points(network, np.vstack(points), np.vstack(normals), network.nodes, tuple(segments))


def _on_spline(network: CurveNetwork, segment: Segment, edge: Ints, share: Floats) -> tuple[Floats, Floats]:
    """Positions and normals (m, 3) at shares of a segment's edges."""
    if not len(edge):
        return np.empty((0, 3)), np.empty((0, 3))
    points, normals = network.points[segment.points], network.normals[segment.points]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(lengths)])
    values = np.column_stack([points, normals])
    closed = segment.points[0] == segment.points[-1]
    spline = CubicSpline(knots, values, bc_type="periodic") if closed else CubicSpline(knots, values)
    values = np.asarray(spline(knots[edge] + share * lengths[edge]))
    return values[:, :3], normalised(values[:, 3:])
