"""Faces with two boundary loops, cut open along a slit so that they can be meshed like the others.

Curves that no other curve connects bound faces like the band between two rings. Two loops bound the same face if most
rays
that leave either along its inward conormal meet the other one first, from the side it faces.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.network import CurveNetwork, Floats, Ints
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.cycles import Cycle

CONE = 0.5  # cosine of the widest angle between a ray and the way to what it meets
RAYS = 64


@dataclass(frozen=True)
class Outline:
    """Boundary of a patch as one closed walk: points, normals (k, 3); vertex (k,) their numbers; cycle, its first one.

    A slit is walked twice; its inner points have numbers above the network's.
    """

    points: Floats
    normals: Floats
    vertex: Ints
    cycle: Cycle


def partners(network: CurveNetwork, cycles: tuple[Cycle, ...]) -> dict[int, int]:
    """Pairs of cycles, by index and in both directions, that bound the same face."""
    points, _, inwards = (np.vstack(a) for a in zip(*(_sides(network, c) for c in cycles), strict=True))
    loop = np.repeat(np.arange(len(cycles)), [len(c.points) for c in cycles])
    first = [_most_met(points, inwards, loop, number) for number in range(len(cycles))]
    return {a: b for a, b in enumerate(first) if b not in (None, a) and first[b] == a}


def plain_outline(network: CurveNetwork, cycle: Cycle) -> Outline:
    """Outline of a face with one loop."""
    return Outline(network.points[cycle.points], network.normals[cycle.points], cycle.points, cycle)


def joined_outline(network: CurveNetwork, one: Cycle, other: Cycle, next_vertex: int) -> Outline:
    """Outline of a face with two loops; the slit's inner points are numbered from next_vertex on."""
    a, b = _shortest_way(network, one, other)
    there, back = np.roll(one.points, -a), np.roll(other.points, -b)
    slit, facing = _slit(network, one, a, other, b)
    number = next_vertex + np.arange(len(slit))
    vertex = np.concatenate([there, there[:1], number, back, back[:1], number[::-1]])
    points, normals = (
        np.vstack([field[there], field[there[:1]], inner, field[back], field[back[:1]], inner[::-1]])
        for field, inner in ((network.points, slit), (network.normals, facing))
    )
    return Outline(points, normals, vertex, one)


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


def _most_met(points: Floats, inwards: Floats, loop: Ints, number: int) -> int | None:
    """The loop that more than half of the rays from a loop meet first; None if there is none."""
    start = np.flatnonzero(loop == number)
    start = start[:: max(1, len(start) // RAYS)]
    met = _meetings(points, inwards, start)
    votes = np.bincount(loop[met.argmin(1)][np.isfinite(met.min(1))], minlength=int(loop.max()) + 1)
    return int(votes.argmax()) if votes.max() > len(start) / 2 else None


def _shortest_way(network: CurveNetwork, one: Cycle, other: Cycle) -> tuple[int, int]:
    """Positions in two cycles between which the way across the face is shortest."""
    points, _, inwards = (np.vstack(pair) for pair in zip(_sides(network, one), _sides(network, other), strict=True))
    count = len(one.points)
    met = _meetings(points, inwards, np.arange(count))[:, count:]
    a, b = np.unravel_index(int(met.argmin()), met.shape)
    return int(a), int(b)


def _slit(network: CurveNetwork, one: Cycle, a: int, other: Cycle, b: int) -> tuple[Floats, Floats]:
    """Inner points and normals of a cubic from one loop to the other, leaving both along their conormals."""
    (start, up, leave), (end, down, enter) = (
        tuple(field[k] for field in _sides(network, cycle)) for cycle, k in ((one, a), (other, b))
    )
    length = float(np.linalg.norm(end - start))
    steps = np.linalg.norm(np.diff(network.points[one.points], axis=0), axis=1).mean()
    t = (np.arange(1, max(1, round(length / steps))) / max(1, round(length / steps)))[:, None]
    path = (1 + 2 * t) * (1 - t) ** 2 * start + t**2 * (3 - 2 * t) * end
    path = path + length * (t * (1 - t) ** 2 * leave + t**2 * (1 - t) * enter)
    return path, normalised((1 - t) * up + t * down)
