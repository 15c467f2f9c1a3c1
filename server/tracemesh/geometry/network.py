"""The reconstructed curve network: the interface between the curve half and the surface half of the kernel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Segment:
    """A polyline between two nodes.

    points: (k,) indices into the network's points; first and last are nodes; a closed curve without nodes repeats its
    first point last. boundary: one face beside it, not two. curve: index of the scanned curve that it is a part of.
    """

    points: Ints
    boundary: bool
    curve: int


@dataclass(frozen=True)
class CurveNetwork:
    """Curves on a surface that meet in nodes.

    points: (n, 3) m, world; every point once, nodes included. normals: (n, 3) outward unit surface normals.
    nodes: (k,) indices of the points that are nodes. segments: the polylines between them. uncertainty: (n,) m, root
    mean square distance of each point from the truth; None where nobody knows it. node_numbers: (k,) what the scan
    calls the nodes, -1 where it has no number for one; None: as they are counted from 0.
    """

    points: Floats
    normals: Floats
    nodes: Ints
    segments: tuple[Segment, ...]
    uncertainty: Floats | None = None
    node_numbers: Ints | None = None

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def extent(self) -> float:
        """Estimated diagonal, m, that lengths in per cent refer to: see `extent_of`."""
        starts, ends = (np.concatenate([s.points[part] for s in self.segments]) for part in (slice(-1), slice(1, None)))
        return extent_of(self.points[starts], self.points[ends])


def extent_of(starts: Floats, ends: Floats) -> float:
    """Diagonal, m, of a box that is filled evenly and has the second moment of straight edges (e, 3) -> (e, 3), m.

    Within a fifth of the bounding box's diagonal for most networks, but the same wherever the world's axes point: the
    root mean square distance of the edges from their centroid, times the square root of 12. Not in the thesis.
    """
    squared = np.sum((ends - starts) ** 2, axis=1)
    length, middle = np.sqrt(squared), (starts + ends) / 2
    total = float(length.sum())
    if total == 0:
        return 0.0
    away = middle - length @ middle / total
    return float(np.sqrt(length @ (12 * np.sum(away**2, axis=1) + squared) / total))
