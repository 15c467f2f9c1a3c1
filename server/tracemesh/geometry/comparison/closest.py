"""Closest points on a triangle mesh, exact whatever the triangles' sizes.

Triangles are sorted into classes of like size, each with a k-d tree of its centroids. A query asks a class for more and
more neighbours until the farthest of them is too far to hold a closer point.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.vectors import dot, lengths

_FIRST_NEIGHBOURS = 8


class ClosestPoints:
    """Answers which point of a mesh is closest to given points; keeps its trees."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        """Prepare for the mesh with vertices (n, 3) m and faces (m, 3)."""
        self.corners = vertices[faces]
        centroids = self.corners.mean(axis=1)
        self._radii = lengths(self.corners - centroids[:, None]).max(axis=1)
        size = np.floor(np.log2(np.maximum(self._radii, self._radii.max() * 2.0**-20))).astype(np.int64)
        members = [np.flatnonzero(size == s) for s in np.unique(size)]
        self._classes = [(m, KDTree(centroids[m]), float(self._radii[m].max())) for m in members]

    def __call__(self, points: Floats) -> tuple[Floats, Floats, Ints]:
        """Barycentric coordinates (n, 3) of the closest points, distances (n,) m, and faces (n,) that hold them."""
        best = _Best(np.zeros((len(points), 3)), np.full(len(points), np.inf), np.zeros(len(points), np.int64))
        for members, tree, radius in self._classes:
            pending, k, seen = np.arange(len(points)), min(_FIRST_NEIGHBOURS, len(members)), 0
            while len(pending):
                reach, neighbour = map(np.asarray, tree.query(points[pending], np.arange(1, k + 1)))
                for new in (slice(seen, seen + 1), slice(seen + 1, k)):  # the first one tells how far others may be
                    self._improve(best, points, pending, members[neighbour[:, new]], reach[:, new])
                done = reach[:, -1] - radius > best.distance[pending]
                pending = pending[~done] if k < len(members) else pending[:0]
                k, seen = min(2 * k, len(members)), k
        return best.weights, best.distance, best.face

    def at(self, weights: Floats, face: Ints) -> Floats:
        """Points (n, 3) m with these barycentric coordinates on these faces."""
        result: Floats = np.einsum("nk,nki->ni", weights, self.corners[face])
        return result

    def _improve(self, best: "_Best", points: Floats, at: Ints, faces: Ints, reach: Floats) -> None:
        """Take the closest of k faces (l, k) for each of the points numbered (l,), where closer than the best known.

        reach: (l, k) m, from the points to the faces' centroids, ascending. Of a face that the circle around its
        centroid keeps too far off, nothing is computed.
        """
        row, column = np.nonzero(reach - self._radii[faces] < best.distance[at, None])
        here, face = at[row], faces[row, column]
        corners = self.corners[face]
        weights = closest_on_triangles(points[here], corners)
        distance = lengths(np.einsum("nk,nki->ni", weights, corners) - points[here])
        order = np.argsort(-distance, kind="stable")  # of those of one point, the last one stays
        order = order[distance[order] < best.distance[here[order]]]
        place = here[order]
        best.weights[place], best.distance[place], best.face[place] = weights[order], distance[order], face[order]


@dataclass(frozen=True)
class _Best:
    """weights: (n, 3) barycentric. distance: (n,) m. face: (n,). Filled in as closer places are found."""

    weights: Floats
    distance: Floats
    face: Ints


def closest_on_triangles(points: Floats, corners: Floats) -> Floats:
    """Barycentric coordinates (n, 3) of the point of each triangle, corners (n, 3, 3), closest to each point (n, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    best, distance = _on_edge(points, a, b, 0, 1)
    for start, end, i, j in ((b, c, 1, 2), (c, a, 2, 0)):
        weights, other = _on_edge(points, start, end, i, j)
        better = other < distance
        best[better], distance[better] = weights[better], other[better]
    normal = np.cross(b - a, c - a)
    area = dot(normal, normal)
    with np.errstate(invalid="ignore", divide="ignore"):  # a triangle without area has edges only
        v = dot(np.cross(points - a, c - a), normal) / area
        w = dot(np.cross(b - a, points - a), normal) / area
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    best[inside] = np.column_stack([1 - v - w, v, w])[inside]
    return best


def _on_edge(points: Floats, start: Floats, end: Floats, i: int, j: int) -> tuple[Floats, Floats]:
    """Barycentric coordinates of the closest points of edges from corner i to corner j, and squared distances."""
    along = end - start
    length = dot(along, along)
    t = np.clip(dot(points - start, along) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    weights = np.zeros((len(points), 3))
    weights[:, i], weights[:, j] = 1 - t, t
    away = start + t[:, None] * along - points
    return weights, dot(away, away)
