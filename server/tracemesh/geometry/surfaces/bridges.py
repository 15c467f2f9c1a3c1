"""Faces with several boundary loops, cut open along slits so that they can be meshed like the others.

Curves that no other curve connects bound faces like the band between two rings, or a plate around its holes. From every
loop rays leave along its inward conormal and vote for the loop that they meet first, from the side that it faces. Two
loops bound the same face if most rays of either meet the other one; or if one of them turns far less than a disk's
boundary does, most of its rays meet other loops, and those that turn little themselves vote back.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from tracemesh.geometry.network import CurveNetwork, Floats, Ints
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.cycles import Cycle

CONE = 0.5  # cosine of the widest angle between a ray and the way to what it meets
RAYS = 64
SMALL_TURNING = 1.1 * np.pi  # rad, of a loop; that of a disk turns by 2 pi less its curvature
LEAST_SHARE = 0.1  # of the rays of a loop that turns little, for a loop that they meet to count


@dataclass(frozen=True)
class Outline:
    """Boundary of a patch as one closed walk: points, normals (k, 3); vertex (k,) their numbers; cycle, its first one.

    A slit is walked twice; its inner points have numbers above the network's.
    """

    points: Floats
    normals: Floats
    vertex: Ints
    cycle: Cycle


def loops_of_faces(network: CurveNetwork, cycles: tuple[Cycle, ...], connected: bool) -> tuple[tuple[int, ...], ...]:
    """Groups of two or more cycles, by index, that are the loops of one face.

    connected: whether every curve is joined to all others; then only cycles that turn little are asked.
    """
    little = np.array([cycle.turning < SMALL_TURNING for cycle in cycles])
    share = _votes(network, cycles, little if connected else np.ones(len(cycles), dtype=bool))
    most = (share > 0.5) & (share.T > 0.5)
    others = share * ~np.eye(len(cycles), dtype=bool)
    meets = (others >= LEAST_SHARE) & (little & (others.sum(1) > 0.5))[:, None]
    largest = np.where(little, 0, others).max(1, keepdims=True)  # of the loops that could bound a disk, one at most
    meets &= np.where(little, meets.T, (others == largest) & (largest > 0))
    linked = (most | meets) & ~np.eye(len(cycles), dtype=bool)
    labels = csgraph.connected_components(sparse.csr_matrix(linked), directed=False)[1]
    groups = (tuple(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels))
    return tuple(group for group in groups if len(group) > 1)


def plain_outline(network: CurveNetwork, cycle: Cycle) -> Outline:
    """Outline of a face with one loop."""
    return Outline(network.points[cycle.points], network.normals[cycle.points], cycle.points, cycle)


def joined_outline(network: CurveNetwork, loops: Sequence[Cycle], next_vertex: int) -> Outline:
    """Outline of a face with several loops; the slits' inner points are numbered from next_vertex on.

    Loop after loop is joined to those before where the way across the face is shortest, never twice at one point.
    """
    walk = _Walk.along(network, loops[0])
    left, used = list(loops[1:]), np.empty(0, np.int64)
    while left:
        others = [_Walk.along(network, cycle) for cycle in left]
        ways = [_shortest_way(walk, other, used) for other in others]
        nearest = int(np.argmin([length for _, _, length in ways]))
        a, b, _ = ways[nearest]
        used = np.append(used, [walk.vertex[a], others[nearest].vertex[b]])
        walk = walk.joined(a, others[nearest], b, next_vertex)
        next_vertex = max(next_vertex, int(walk.vertex.max()) + 1)
        del left[nearest]
    return Outline(walk.points, walk.normals, walk.vertex, loops[0])


@dataclass(frozen=True)
class _Walk:
    """A closed walk: points, normals, inward conormals (k, 3), numbers of the points (k,)."""

    points: Floats
    normals: Floats
    inwards: Floats
    vertex: Ints

    @classmethod
    def along(cls, network: CurveNetwork, cycle: Cycle) -> "_Walk":
        return cls(*_sides(network, cycle), cycle.points)

    def joined(self, a: int, other: "_Walk", b: int, next_vertex: int) -> "_Walk":
        """The walk to position a, along a slit around another walk from b to b, and back to a and on."""
        steps = float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).mean())
        slit, facing = _slit(self, a, other, b, steps)
        number = next_vertex + np.arange(len(slit))
        there, back = np.arange(a, len(self.points) + a + 1), np.arange(b, len(other.points) + b + 1)
        there, back = there % len(self.points), back % len(other.points)
        parts = (
            (self.points[there], slit, other.points[back], slit[::-1]),
            (self.normals[there], facing, other.normals[back], facing[::-1]),
            (self.inwards[there], 0 * slit, other.inwards[back], 0 * slit),
        )
        vertex = np.concatenate([self.vertex[there], number, other.vertex[back], number[::-1]])
        points, normals, inwards = (np.vstack(part) for part in parts)
        return _Walk(points, normals, inwards, vertex)


def _sides(network: CurveNetwork, cycle: Cycle) -> tuple[Floats, Floats, Floats]:
    """Points, normals and inward conormals N x t along a cycle."""
    points, normals = network.points[cycle.points], network.normals[cycle.points]
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    return points, normals, normalised(np.cross(normals, along))


def _meetings(points: Floats, inwards: Floats, start: Ints) -> NDArray[np.float64]:
    """(rays, n) distance to every point that a ray from a start meets from the right side; infinite otherwise."""
    way = points - points[start][:, None]
    distance = np.linalg.norm(way, axis=2)
    leaves = (way * inwards[start][:, None]).sum(2) > CONE * distance
    enters = -(way * inwards).sum(2) > CONE * distance
    return np.where(leaves & enters & (distance > 0), distance, np.inf)


def _votes(network: CurveNetwork, cycles: tuple[Cycle, ...], asked: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(c, c) share of the rays from every cycle asked (c,) that meet every other one, or itself, first."""
    points, _, inwards = (np.vstack(a) for a in zip(*(_sides(network, c) for c in cycles), strict=True))
    loop = np.repeat(np.arange(len(cycles)), [len(c.points) for c in cycles])
    share = np.zeros((len(cycles), len(cycles)))
    for number in np.flatnonzero(asked):
        start = np.flatnonzero(loop == number)
        start = start[:: max(1, len(start) // RAYS)]
        met = _meetings(points, inwards, start)
        first = loop[met.argmin(1)][np.isfinite(met.min(1))]
        share[number] = np.bincount(first, minlength=len(cycles)) / len(start)
    return share


def _shortest_way(one: _Walk, other: _Walk, used: Ints) -> tuple[int, int, float]:
    """Positions in two walks between which the way across the face is shortest, and its length; not at used points."""
    points, inwards = np.vstack([one.points, other.points]), np.vstack([one.inwards, other.inwards])
    count = len(one.points)
    met = _meetings(points, inwards, np.arange(count))[:, count:]
    if not np.isfinite(met).any():  # no two points face each other
        met = np.linalg.norm(one.points[:, None] - other.points, axis=2)
    met[np.isin(one.vertex, used) | ~one.inwards.any(1)] = np.inf
    a, b = np.unravel_index(int(met.argmin()), met.shape)
    return int(a), int(b), float(met[a, b])


def _slit(one: _Walk, a: int, other: _Walk, b: int, steps: float) -> tuple[Floats, Floats]:
    """Inner points and normals of a cubic from one walk to another, leaving both along their conormals; steps: m."""
    start, up, leave = one.points[a], one.normals[a], one.inwards[a]
    end, down, enter = other.points[b], other.normals[b], other.inwards[b]
    length = float(np.linalg.norm(end - start))
    parts = max(1, round(length / steps))
    t = (np.arange(1, parts) / parts)[:, None]
    path = (1 + 2 * t) * (1 - t) ** 2 * start + t**2 * (3 - 2 * t) * end
    path = path + length * (t * (1 - t) ** 2 * leave + t**2 * (1 - t) * enter)
    return path, normalised((1 - t) * up + t * down)
