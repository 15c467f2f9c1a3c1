"""Closest points on a triangle mesh, exact whatever the triangles' sizes.

Triangles are sorted into classes of like size, each with a k-d tree of its centroids. A query asks a class for more and
more neighbours until the farthest of them is too far to hold a closer point.
"""

import numpy as np
from scipy.spatial import KDTree

from tracemesh.geometry.network import Floats, Ints

_FIRST_NEIGHBOURS = 8


class ClosestPoints:
    """Answers which point of a mesh is closest to given points; keeps its trees."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        """Prepare for the mesh with vertices (n, 3) m and faces (m, 3)."""
        self.corners = vertices[faces]
        centroids = self.corners.mean(axis=1)
        radii = np.linalg.norm(self.corners - centroids[:, None], axis=2).max(axis=1)
        size = np.floor(np.log2(np.maximum(radii, radii.max() * 2.0**-20))).astype(np.int64)
        members = [np.flatnonzero(size == s) for s in np.unique(size)]
        self._classes = [(m, KDTree(centroids[m]), float(radii[m].max())) for m in members]

    def __call__(self, points: Floats) -> tuple[Floats, Floats, Ints]:
        """Barycentric coordinates (n, 3) of the closest points, distances (n,) m, and faces (n,) that hold them."""
        weights, face = np.zeros((len(points), 3)), np.zeros(len(points), np.int64)
        distance = np.full(len(points), np.inf)
        for members, tree, radius in self._classes:
            pending, k = np.arange(len(points)), min(_FIRST_NEIGHBOURS, len(members))
            while len(pending):
                reach, neighbour = tree.query(points[pending], np.arange(1, k + 1))
                found = self._best(points[pending], members[neighbour])
                better = found[1] < distance[pending]
                at = pending[better]
                weights[at], distance[at], face[at] = (part[better] for part in found)
                done = np.asarray(reach)[:, -1] - radius > distance[pending]
                pending = pending[~done] if k < len(members) else pending[:0]
                k = min(2 * k, len(members))
        return weights, distance, face

    def at(self, weights: Floats, face: Ints) -> Floats:
        """Points (n, 3) m with these barycentric coordinates on these faces."""
        result: Floats = np.einsum("nk,nki->ni", weights, self.corners[face])
        return result

    def _best(self, points: Floats, candidates: Ints) -> tuple[Floats, Floats, Ints]:
        """The best of k candidate faces (n, k) for each point."""
        n, k = candidates.shape
        corners = self.corners[candidates.ravel()]
        weights = closest_on_triangles(np.repeat(points, k, axis=0), corners)
        offset = np.einsum("nk,nki->ni", weights, corners) - np.repeat(points, k, axis=0)
        distance = np.linalg.norm(offset, axis=1).reshape(n, k)
        best = distance.argmin(axis=1)
        rows = np.arange(n)
        return weights.reshape(n, k, 3)[rows, best], distance[rows, best], candidates[rows, best]


def closest_on_triangles(points: Floats, corners: Floats) -> Floats:
    """Barycentric coordinates (n, 3) of the point of each triangle, corners (n, 3, 3), closest to each point (n, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    best, distance = _on_edge(points, a, b, 0, 1)
    for start, end, i, j in ((b, c, 1, 2), (c, a, 2, 0)):
        weights, other = _on_edge(points, start, end, i, j)
        better = other < distance
        best[better], distance[better] = weights[better], other[better]
    normal = np.cross(b - a, c - a)
    area = np.einsum("ij,ij->i", normal, normal)
    with np.errstate(invalid="ignore", divide="ignore"):  # a triangle without area has edges only
        v = np.einsum("ij,ij->i", np.cross(points - a, c - a), normal) / area
        w = np.einsum("ij,ij->i", np.cross(b - a, points - a), normal) / area
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    best[inside] = np.column_stack([1 - v - w, v, w])[inside]
    return best


def _on_edge(points: Floats, start: Floats, end: Floats, i: int, j: int) -> tuple[Floats, Floats]:
    """Barycentric coordinates of the closest points of edges from corner i to corner j, and squared distances."""
    along = end - start
    length = np.einsum("ij,ij->i", along, along)
    t = np.clip(np.einsum("ij,ij->i", points - start, along) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    weights = np.zeros((len(points), 3))
    weights[:, i], weights[:, j] = 1 - t, t
    return weights, np.sum((start + t[:, None] * along - points) ** 2, axis=1)
