"""Refinement of a spanned surface: positions and normals together, of least variation of curvature.

The linear solve propagates normals first and fits positions to their curvature afterwards; nothing makes the two agree.
Here every free vertex moves along its normal and turns it, and Gauss-Newton minimises

    E = integral |grad S|^2 + length^2 integral (lap 2H)^2 + w/h^4 integral (e . N / |e|)^2

with S the shape operator -dN (curvature_variation.py), and the last term the slope between edges e and the normals at
their
ends. Zero on spheres; nothing extra on an open boundary, where position and normal are data.

The evidence for the refined surface is the factor by which E falls, times the slope of the given surface against its
own normals over the slope of the network's edges against theirs: what the network itself leaves open proves nothing. It
grows with the third power of the resolution, so it is told as for one resolution.

Rejected: E without the second term (networks cut from meshes: worse on ten of eleven); principal-direction weights
(worse
except on few curves); one factorisation for all steps (diverges); nested dissection and LDL (slower than minimum
degree).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tracemesh.geometry.factorisation import Factorisation
from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.curvature_variation import Shape, variation_rows
from tracemesh.geometry.surfaces.edges import boundary_vertices, interior_edges, unique_edges
from tracemesh.geometry.surfaces.laplacian import triangle_areas
from tracemesh.geometry.surfaces.quality import inverted_faces
from tracemesh.geometry.vectors import dot, lengths

CONTACT_WEIGHT = 1000.0  # w: from 100 on, results no longer depend on it; much beyond, noise in the normals shows
LENGTH_PER_PATCH = 0.4  # length over the root of the mean patch area
LARGEST_STEP = 2.0  # along the normal, in mesh sizes
LARGEST_TURN = 0.7  # rad
CONVERGED = 0.1  # largest move of the last step, in mesh sizes
STEPS = 3
KNOWN_SIZE = 0.021  # mesh size over the root of the area, of the networks that the next number was found with
# Between the evidence of networks that gained (389 and more) and of those that lost (51 and less), among 26.
ENOUGH_EVIDENCE = 130.0
LARGEST_MOVE = 0.25  # of a patch that is still trusted, over the root of its area


@dataclass(frozen=True)
class Refined:
    """vertices, normals: (n, 3). evidence: how far the surface as given contradicted its own normals; see
    `evidence`.
    """

    vertices: Floats
    normals: Floats
    evidence: float

    @property
    def convincing(self) -> bool:
        """Whether the network asks for the refined surface, or is as well served by the one given."""
        return self.evidence > ENOUGH_EVIDENCE


def refine(vertices: Floats, normals: Floats, faces: Ints, patch: Ints, fixed: int) -> Refined:
    """Refine a surface whose first `fixed` vertices and normals stay.

    vertices: (n, 3) m. normals: (n, 3) unit. faces: (f, 3). patch: (f,) the patch of every face. A patch that would
    gain an
    inverted triangle or move too far keeps the surface given.
    """
    areas = triangle_areas(vertices[faces])
    size = float(np.sqrt(areas.mean() * 4 / np.sqrt(3)))
    length = LENGTH_PER_PATCH * float(np.sqrt(areas.sum() / (patch.max() + 1)))
    given = shape = Shape(vertices, normals, faces, interior_edges(faces), boundary_vertices(faces, len(vertices)))
    energies = []
    with np.errstate(all="ignore"):  # where steps diverge, the surface given is kept
        for _ in range(STEPS):
            shape, energy, move = _gauss_newton_step(shape, fixed, length, size)
            energies.append(energy)
            if not move >= CONVERGED * size:
                break
        residual = _system(shape, length, size)[1]
        kept = untrusted(faces, patch, (vertices, normals), (shape.vertices, shape.normals))[:, None]
    after = float(residual @ residual) if np.isfinite(residual).all() else np.inf
    gain = energies[0] / max(after, 1e-30 * energies[0], np.finfo(float).tiny)
    return Refined(
        np.where(kept, vertices, shape.vertices),
        np.where(kept, normals, shape.normals),
        float(gain * _disagreement(given, fixed) * (size / (KNOWN_SIZE * np.sqrt(areas.sum()))) ** 3),
    )


def _disagreement(shape: Shape, fixed: int) -> float:
    """Slope of the surface's edges against its normals, over that of the network's own edges (root mean squares)."""
    edges = unique_edges(shape.faces)[0]
    vector = shape.vertices[edges[:, 1]] - shape.vertices[edges[:, 0]]
    both = shape.normals[edges[:, 0]] + shape.normals[edges[:, 1]]
    slope = dot(vector, both) / (2 * lengths(vector))
    on_network = edges.max(1) < fixed
    data, inside = (np.sqrt(np.mean(slope[mask] ** 2)) for mask in (on_network, ~on_network))
    return float(inside / max(data, np.finfo(float).eps))


def untrusted(
    faces: Ints, patch: Ints, given: tuple[Floats, Floats], refined: tuple[Floats, Floats]
) -> NDArray[np.bool_]:
    """(n,) vertices of patches that gained an inverted triangle or moved too far.

    faces: (f, 3). patch: (f,). given, refined: vertices and normals (n, 3) before and after.
    """
    before, after = (inverted_faces(vertices, faces, normals) for vertices, normals in (given, refined))
    worse = np.bincount(patch, after) > np.bincount(patch, before)
    moved = lengths(refined[0] - given[0])[faces].max(1)
    area = np.bincount(patch, triangle_areas(given[0][faces]))
    np.logical_or.at(worse, patch, ~(moved <= LARGEST_MOVE * np.sqrt(area[patch])))
    mask = np.zeros(len(given[0]), bool)
    mask[faces[worse[patch]]] = True
    return mask


def _gauss_newton_step(shape: Shape, fixed: int, length: float, size: float) -> tuple[Shape, float, float]:
    """The shape after one step, the energy before it, and the largest move along the normals, m."""
    jacobian, residual, first, second = _system(shape, length, size)
    jacobian = jacobian[:, 3 * fixed :]
    matrix = (jacobian.T @ jacobian).tocsc()
    factor = Factorisation(matrix, shuffled=True)
    step = np.zeros((len(shape.vertices), 3))
    step[fixed:] = -factor.solve(jacobian.T @ residual).reshape(-1, 3)
    along = np.clip(step[:, 0], -LARGEST_STEP * size, LARGEST_STEP * size)
    turn = np.linalg.norm(step[:, 1:], axis=1)
    step[:, 1:] *= np.minimum(1, LARGEST_TURN / np.maximum(turn, LARGEST_TURN))[:, None]
    normals = normalised(shape.normals + step[:, 1:2] * first + step[:, 2:] * second)
    normals[:fixed] = shape.normals[:fixed]
    moved = replace(shape, vertices=shape.vertices + along[:, None] * shape.normals, normals=normals)
    return moved, float(residual @ residual), float(np.abs(along).max())


def _system(shape: Shape, length: float, size: float) -> tuple[sparse.csr_matrix, Floats, Floats, Floats]:
    """Jacobian and residual; columns are (move along N, turn towards first, turn towards second) of every vertex."""
    first = normalised(np.cross(shape.normals, np.eye(3)[np.argmin(np.abs(shape.normals), axis=1)]))
    second = np.cross(shape.normals, first)
    count = len(shape.vertices)
    variation = variation_rows(shape, length)
    rows = np.tile(np.arange(3 * count), 2)
    columns = np.repeat(np.concatenate([3 * np.arange(count) + 1, 3 * np.arange(count) + 2]), 3)
    values = np.concatenate([first.ravel(), second.ravel()])
    turns = sparse.csr_matrix((values, (rows, columns)), (3 * count, 3 * count))
    contact, slope = _contact_rows(shape, first, second, size)
    jacobian = sparse.vstack([variation @ turns, contact]).tocsr()
    return jacobian, np.concatenate([variation @ shape.normals.ravel(), slope]), first, second


def _contact_rows(shape: Shape, first: Floats, second: Floats, size: float) -> tuple[sparse.csr_matrix, Floats]:
    """One row per interior edge: its slope against the mean normal of its ends, weighted."""
    i, j = shape.edges.start, shape.edges.end
    edge = shape.vertices[j] - shape.vertices[i]
    normal = 0.5 * (shape.normals[i] + shape.normals[j])
    areas = triangle_areas(shape.vertices[shape.faces])
    area = (areas[shape.edges.left] + areas[shape.edges.right]) / 3
    weight = np.sqrt(CONTACT_WEIGHT * area) / (size**2 * lengths(edge))
    moves = [weight * sign * dot(shape.normals[end], normal) for sign, end in ((-1, i), (1, j))]
    turns = [weight * dot(edge, axis[end]) / 2 for end in (i, j) for axis in (first, second)]
    values = np.concatenate([*moves, *turns])
    columns = np.concatenate([3 * i, 3 * j, 3 * i + 1, 3 * i + 2, 3 * j + 1, 3 * j + 2])
    rows = np.tile(np.arange(len(i)), 6)
    matrix = sparse.csr_matrix((values, (rows, columns)), (len(i), 3 * len(shape.vertices)))
    return matrix, weight * dot(edge, normal)
