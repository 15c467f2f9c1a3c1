"""Linear surfaces over the same planar patches, to compare with: biharmonic, triharmonic, and the thesis's own."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from benchmarks.measuring import Floats, Ints, vertex_areas
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.surfaces.cell_complex import cell_complex
from tracemesh.geometry.surfaces.curvature import mean_curvature, normalised
from tracemesh.geometry.surfaces.laplacian import cotangent_laplacian
from tracemesh.geometry.surfaces.patches import triangulate_patches


@dataclass(frozen=True)
class Patches:
    """network: what the first vertices are held to. faces: (m, 3), in space; patch: (m,) that each belongs to; planar:
    (m, 3, 2) m, its corners in the patch's plane. stiffness: C, negative semidefinite; mass: (n,) m^2, in the plane.
    """

    network: CurveNetwork
    faces: Ints
    patch: Ints
    planar: Floats
    stiffness: sparse.csr_matrix
    mass: Floats


Method = Callable[[Patches], Floats]
"""Vertices (n, 3) of a surface over the patches."""


def planar_patches(network: CurveNetwork) -> Patches:
    patches = triangulate_patches(cell_complex(network), None, 1.0)
    planar = patches.planar[patches.planar_faces]
    laplacian = cotangent_laplacian(planar, patches.faces, patches.count)
    return Patches(network, patches.faces, patches.patch, planar, laplacian.stiffness, laplacian.mass)


def biharmonic(patches: Patches) -> Floats:
    """C M^-1 C X = 0: the thesis's base surface (Eq. 4.12)."""
    return _solve(patches, _power(patches, 2), patches.network.points)


def triharmonic(patches: Patches) -> Floats:
    """C M^-1 C M^-1 C X = 0."""
    return _solve(patches, _power(patches, 3), patches.network.points)


def thesis(patches: Patches) -> Floats:
    """Least squares of L X = -2 H N with H from the base surface and propagated normals (Eq. 4.18-4.23), its sign kept.

    C X is an integral over area, and that of H is taken over the base surface: the same mass in L and H.
    """
    matrix = _power(patches, 2)
    base = _solve(patches, matrix, patches.network.points)
    normals = normalised(_solve(patches, matrix, patches.network.normals))
    integral = mean_curvature(base, patches.faces, normals) * vertex_areas(base, patches.faces)
    target = (-2 * integral / patches.mass)[:, None] * normals
    return _solve(patches, matrix, patches.network.points, patches.stiffness @ target)


def _power(patches: Patches, order: int) -> sparse.csc_matrix:
    inverse_mass = sparse.diags(1 / patches.mass)
    matrix = patches.stiffness
    for _ in range(order - 1):
        matrix = matrix @ inverse_mass @ patches.stiffness
    return matrix.tocsc()


def _solve(patches: Patches, matrix: sparse.csc_matrix, known: Floats, right: Floats | None = None) -> Floats:
    fixed = len(known)
    target = np.zeros((matrix.shape[0], 3)) if right is None else right
    free = matrix[fixed:]
    solved = splu(free[:, fixed:].tocsc()).solve(target[fixed:] - free[:, :fixed] @ known)
    return np.vstack([known, solved])
