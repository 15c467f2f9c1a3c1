"""Patches unrolled into the plane as rigidly as possible (Liu et al. 2008, "A Local/Global Approach to Mesh
Parameterization").

A patch triangulated in a near-isometric plane has well-shaped triangles in space, which the projection along the
average
normal cannot give where the patch is steep. All patches are unrolled by one factorisation.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from tracemesh.geometry.factorisation import Factorisation
from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.laplacian import cotangent_weights

Complexes = NDArray[np.complex128]
SMALLEST_WEIGHT = 0.01  # keeps the system definite where triangles are obtuse
STEPS = 4


def flatten(vertices: Floats, faces: Ints, planar: Floats, pinned: Ints) -> Floats:
    """(n, 2) m, plane positions with the triangles' shapes kept as well as can be.

    vertices: (n, 3) m, of separate patches. faces: (f, 3). planar: (n, 2) a first map to the plane.
    pinned: one vertex of every patch, which stays where it is.
    """
    corners = vertices[faces]
    weights = np.maximum(cotangent_weights(corners), SMALLEST_WEIGHT)
    wanted = _opposite(_isometric(corners))
    free = np.setdiff1d(np.arange(len(vertices)), pinned)
    matrix = _stiffness(faces, weights, len(vertices))[free]
    factor = Factorisation(matrix[:, free])
    position = planar[:, 0] + 1j * planar[:, 1]
    for _ in range(STEPS):
        turn = (weights * _opposite(position[faces]) * wanted.conj()).sum(1)
        pull = weights * wanted * (turn / np.maximum(np.abs(turn), np.finfo(float).tiny))[:, None]
        right = _divergence(faces, pull, len(vertices))[free] - matrix[:, pinned] @ position[pinned]
        solved = factor.solve(np.column_stack([right.real, right.imag]))
        position[free] = solved[:, 0] + 1j * solved[:, 1]
    return np.column_stack([position.real, position.imag])


def holes_filled(vertices: Floats, faces: Ints, planar: Floats, patch: Ints) -> tuple[Floats, Ints, Floats]:
    """Vertices, faces and plane positions with a fan of triangles, around one more vertex, in every hole of a patch.

    vertices: (n, 3) m. faces: (f, 3). planar: (n, 2) m. patch: (n,) number of the patch that a vertex belongs to; the
    longest boundary of a patch is its outer one. Flattened alone, the rim of a hole in a dome turns inside out.
    """
    start, end, ring = _boundary_edges(faces, len(vertices))
    length = np.bincount(ring, np.linalg.norm(vertices[end] - vertices[start], axis=1))
    longest = np.zeros(int(patch.max()) + 1)
    np.maximum.at(longest, patch[start], length[ring])
    inner = length[ring] < longest[patch[start]]
    start, end = start[inner], end[inner]
    hole = np.unique(ring[inner], return_inverse=True)[1]
    fans = np.column_stack([end, start, len(vertices) + hole])
    centres, places = _means(vertices[start], hole), _means(planar[start], hole)
    return np.vstack([vertices, centres]), np.vstack([faces, fans]), np.vstack([planar, places])


def _boundary_edges(faces: Ints, count: int) -> tuple[Ints, Ints, Ints]:
    """(e,) start and end of every edge with one face, along it, and the number of the boundary that it is part of."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    alone = ~np.isin(start * count + end, end * count + start)
    start, end = start[alone], end[alone]
    joined = sparse.csr_matrix((np.ones(len(start)), (start, end)), (count, count))
    labels = csgraph.connected_components(joined, directed=False)[1].astype(np.int64)
    return start, end, labels[start]


def _means(values: Floats, group: Ints) -> Floats:
    """(groups, d) means of the values (n, d) of every group (n,)."""
    total = np.zeros((int(group.max(initial=-1)) + 1, values.shape[1]))
    np.add.at(total, group, values)
    return np.asarray(total / np.bincount(group)[:, None])


def _isometric(corners: Floats) -> Complexes:
    """(f, 3) complex, every triangle (f, 3, 3) laid in the plane of complex numbers."""
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(side, axis=1)
    along = (side * other).sum(1) / length
    across = np.linalg.norm(np.cross(side, other), axis=1) / length
    return np.column_stack([np.zeros(len(side)), length, along + 1j * across])


def _opposite(corners: Complexes) -> Complexes:
    """(f, 3) complex, the edge opposite of every corner."""
    return np.asarray(np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1))


def _stiffness(faces: Ints, weights: Floats, count: int) -> sparse.csc_matrix:
    """Positive semidefinite Laplacian with the given weights of opposite edges."""
    i, j, w = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel(), weights.ravel()
    rows, columns = np.concatenate([i, j, i, j]), np.concatenate([j, i, i, j])
    return sparse.csc_matrix((np.concatenate([-w, -w, w, w]), (rows, columns)), (count, count))


def _divergence(faces: Ints, pull: Complexes, count: int) -> Complexes:
    """(n,) complex, sum of the pulls (f, 3) along opposite edges at their ends."""
    total = np.zeros(count, complex)
    np.add.at(total, np.roll(faces, -2, axis=1), pull)
    np.add.at(total, np.roll(faces, -1, axis=1), -pull)
    return total
