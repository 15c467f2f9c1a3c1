"""Edges of a triangle mesh and the faces beside them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.network import Ints


@dataclass(frozen=True)
class InteriorEdges:
    """Edges with two faces. start, end: (e,) vertices of an edge, in the order of its left face. left_tip, right_tip:
    (e,)
    third vertices of the two faces. left, right: (e,) the faces.
    """

    start: Ints
    end: Ints
    left_tip: Ints
    right_tip: Ints
    left: Ints
    right: Ints


def interior_edges(faces: Ints) -> InteriorEdges:
    """All edges of an edge-manifold mesh (f, 3) that have two faces."""
    start, end, tip = (np.roll(faces, -k, axis=1).ravel() for k in range(3))
    key = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[first], order[first + 1]
    return InteriorEdges(start[one], end[one], tip[one], tip[other], one // 3, other // 3)


def unique_edges(faces: Ints) -> tuple[Ints, Ints]:
    """(e, 2) edges, smaller index first, and (e,) the number of faces beside each."""
    pairs = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    size = int(faces.max()) + 1
    keys, count = np.unique(pairs[:, 0] * size + pairs[:, 1], return_counts=True)
    return np.column_stack([keys // size, keys % size]), count


def boundary_vertices(faces: Ints, count: int) -> NDArray[np.bool_]:
    """(n,) whether a vertex lies on an edge with one face."""
    edges, beside = unique_edges(faces)
    mask = np.zeros(count, bool)
    mask[edges[beside == 1]] = True
    return mask
