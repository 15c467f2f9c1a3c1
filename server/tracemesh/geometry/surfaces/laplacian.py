"""Cotangent Laplacians of triangle meshes (thesis section 2.8, Eq. 2.40).

L = M^-1 C with C the cotangent matrix, negative semidefinite, and M the lumped mass (a third of the areas around a
vertex).
"""

from dataclasses import dataclass

import numpy as np
import robust_laplacian
from scipy import sparse

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.vectors import dot

MOST_NEGATIVE_WEIGHT = -0.1  # of an edge: two angles that add to 192 degrees


@dataclass(frozen=True)
class Laplacian:
    """stiffness: (n, n) cotangent matrix C, no unit. mass: (n,) lumped area, m^2."""

    stiffness: sparse.csr_matrix
    mass: Floats


def cotangent_laplacian(corners: Floats, faces: Ints, count: int) -> Laplacian:
    """Laplacian of faces in any embedding, even one that differs from patch to patch.

    corners: (f, 3, d) positions of every face's corners, m. faces: (f, 3) vertex indices below count.
    """
    weights = cotangent_weights(corners).ravel()
    i, j = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel()
    rows, columns = np.concatenate([i, j, i, j]), np.concatenate([j, i, i, j])
    values = np.concatenate([weights, weights, -weights, -weights])
    stiffness = sparse.csr_matrix((values, (rows, columns)), (count, count))
    return Laplacian(stiffness, lumped_mass(triangle_areas(corners), faces, count))


def surface_laplacian(vertices: Floats, faces: Ints) -> Laplacian:
    """Laplacian of a mesh in space. vertices: (n, 3) m. faces: (f, 3).

    On a Delaunay mesh the cotangent Laplacian; otherwise that of its intrinsic Delaunay triangulation (Sharp and Crane
    2020),
    which is the same where the mesh is Delaunay and has no negative weights, however bad the faces.
    """
    plain = cotangent_laplacian(vertices[faces], faces, len(vertices))
    if sparse.triu(plain.stiffness, k=1).data.min() > MOST_NEGATIVE_WEIGHT:
        return plain
    stiffness, mass = robust_laplacian.mesh_laplacian(vertices, faces)
    return Laplacian(sparse.csr_matrix(-stiffness), np.asarray(mass.diagonal()))


def cotangent_weights(corners: Floats) -> Floats:
    """(f, 3) half the cotangent of the angle at every corner; the weight of the opposite edge. corners: (f, 3,
    2 or 3).
    """
    a, b, c = (corners[:, k] for k in range(3))
    dots = np.column_stack([dot(b - a, c - a), dot(c - b, a - b), dot(a - c, b - c)])
    return np.asarray(dots / (4 * triangle_areas(corners)[:, None]))


def triangle_areas(corners: Floats) -> Floats:
    """(f,) m^2. corners: (f, 3, 2 or 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    gram = dot(a, a) * dot(b, b) - dot(a, b) ** 2
    return np.asarray(0.5 * np.sqrt(np.maximum(gram, np.finfo(float).tiny)))


def lumped_mass(area: Floats, faces: Ints, count: int) -> Floats:
    """(n,) a third of the areas of the faces around every vertex."""
    return np.bincount(faces.ravel(), np.repeat(area / 3, 3), count).astype(np.float64)
