"""Faces of a curve network, traced around its nodes (thesis section 4.4.1, code snippet 4.9)."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.network import CurveNetwork, Floats, Ints


@dataclass(frozen=True)
class HalfSegment:
    """One side of a segment: index of the segment, and whether the face on its left sees it from first to last
    point.
    """

    segment: int
    forward: bool

    @property
    def twin(self) -> "HalfSegment":
        """The other side of the same segment."""
        return HalfSegment(self.segment, not self.forward)


@dataclass(frozen=True)
class Cycle:
    """A closed walk along segments with one face on its left, seen from outside.

    sides: the half-segments in order. points: (k,) indices into the network's points, every one once per visit.
    turning: total geodesic turning along the walk, rad; 2 pi minus the integral of the Gaussian curvature if the face
    is a disk.
    """

    sides: tuple[HalfSegment, ...]
    points: Ints
    turning: float


def trace_cycles(network: CurveNetwork) -> tuple[Cycle, ...]:
    """All cycles of a network; every half-segment is in exactly one of them, openings included.

    At a node the next side is the first one clockwise from the way back, in the node's tangent plane.
    """
    following = _following_sides(network)
    unseen = dict.fromkeys(following)
    cycles = []
    while unseen:
        start = side = next(iter(unseen))
        sides = []
        while True:
            del unseen[side]
            sides.append(side)
            side = following[side]
            if side == start:
                break
        points = loop_points(network, tuple(sides))
        cycles.append(Cycle(tuple(sides), points, geodesic_turning(network.points[points], network.normals[points])))
    return tuple(cycles)


def loop_points(network: CurveNetwork, sides: tuple[HalfSegment, ...]) -> Ints:
    """(k,) point indices along a closed walk, without repeating the first."""
    return np.concatenate([side_points(network, side)[:-1] for side in sides])


def side_points(network: CurveNetwork, side: HalfSegment) -> Ints:
    """(k,) point indices of a segment in the direction of the side."""
    points = network.segments[side.segment].points
    return points if side.forward else points[::-1]


def geodesic_turning(points: Floats, normals: Floats) -> float:
    """Sum of the signed turning angles of a closed polygon, each measured in the tangent plane of its corner, rad.

    points, normals: (k, 3). Counter-clockwise turns seen from outside are positive; a flat convex loop has 2 pi.
    """
    return float(turning_angles(points, normals).sum())


def turning_angles(points: Floats, normals: Floats) -> NDArray[np.float64]:
    """(k,) rad, the signed turning angle at every corner of a closed polygon. points, normals: (k, 3)."""
    ahead = np.roll(points, -1, axis=0) - points
    behind = np.roll(ahead, 1, axis=0)
    ahead, behind = (e - (e * normals).sum(1, keepdims=True) * normals for e in (ahead, behind))
    return np.asarray(np.arctan2((np.cross(behind, ahead) * normals).sum(1), (behind * ahead).sum(1)))


def _following_sides(network: CurveNetwork) -> dict[HalfSegment, HalfSegment]:
    """For every half-segment the next one of its cycle."""
    leaving: dict[int, list[HalfSegment]] = defaultdict(list)
    for index in range(len(network.segments)):
        for side in (HalfSegment(index, True), HalfSegment(index, False)):
            leaving[int(side_points(network, side)[0])].append(side)
    following = {}
    for node, sides in leaving.items():
        ring = [sides[k] for k in np.argsort(_polar_angles(network, node, sides), kind="stable")]
        for counter_clockwise, side in zip(ring[1:] + ring[:1], ring, strict=True):
            following[counter_clockwise.twin] = side
    return following


def _polar_angles(network: CurveNetwork, node: int, sides: list[HalfSegment]) -> NDArray[np.float64]:
    """(k,) rad, direction of every leaving side in the node's tangent plane (Eq. 4.10), counter-clockwise from
    outside.
    """
    towards = network.points[[side_points(network, side)[1] for side in sides]] - network.points[node]
    normal = network.normals[node]
    tangent = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    return np.asarray(np.arctan2(towards @ np.cross(normal, tangent), towards @ tangent))
