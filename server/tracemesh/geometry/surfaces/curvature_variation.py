"""The variation of curvature of a mesh with normals, as linear functionals of the normals at the vertices.

Two measures, both zero on spheres and planes. The jump of the conormal derivative of N across every edge discretises
the
integral of the squared derivative of the shape operator; the Laplacian of the mean curvature div N adds one order more.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.edges import InteriorEdges
from tracemesh.geometry.surfaces.laplacian import cotangent_weights, lumped_mass, triangle_areas
from tracemesh.geometry.vectors import dot

SMALLEST_WEIGHT = 0.02  # of an edge in the Laplacian of the curvature: keeps it semidefinite where triangles are obtuse


@dataclass(frozen=True)
class Shape:
    """A mesh at one step: vertices and normals (n, 3), faces (f, 3), its interior edges, (n,) mask of the open
    boundary.
    """

    vertices: Floats
    normals: Floats
    faces: Ints
    edges: InteriorEdges
    open_boundary: NDArray[np.bool_]


def variation_rows(shape: Shape, length: float) -> sparse.csr_matrix:
    """Rows r with sum (r N)^2 = integral |grad S|^2 + length^2 (lap 2H)^2; columns are the components of all normals.

    length: m, the wavelength (over 2 pi) at which both terms weigh the same.
    """
    weights = cotangent_weights(shape.vertices[shape.faces])
    jumps = _jump_rows(shape, weights)
    return sparse.vstack([jumps, length * _curvature_laplacian_rows(shape, weights)]).tocsr()


def _jump_rows(shape: Shape, weights: Floats) -> sparse.csr_matrix:
    """Two rows per interior edge: the jump of the conormal derivative of N, along the edge and across it."""
    edges, areas = shape.edges, triangle_areas(shape.vertices[shape.faces])
    at_start, at_end = (_cotangents_at(shape, weights, ends) for ends in (edges.start, edges.end))
    scale = 2 * np.sqrt(3 / (areas[edges.left] + areas[edges.right]))
    stencil = np.stack([at_end.sum(0), at_start.sum(0), *(-(at_start + at_end))]) * scale
    corners = np.stack([edges.start, edges.end, edges.left_tip, edges.right_tip])
    middle = normalised(shape.normals[edges.start] + shape.normals[edges.end])
    along = shape.vertices[edges.end] - shape.vertices[edges.start]
    along = normalised(along - dot(along, middle)[:, None] * middle)
    columns = (3 * corners.T[:, :, None] + np.arange(3)).ravel()
    rows = np.repeat(np.arange(len(along)), 12)
    size = (len(along), 3 * len(shape.vertices))
    directions = (along, np.cross(middle, along))
    blocks = [(stencil.T[:, :, None] * direction[:, None]).ravel() for direction in directions]
    return sparse.vstack([sparse.csr_matrix((block, (rows, columns)), size) for block in blocks])


def _cotangents_at(shape: Shape, weights: Floats, vertex: Ints) -> Floats:
    """(2, e) half the cotangents of the angles at one end of every edge, in its left and its right face."""
    sides = (shape.edges.left, shape.edges.right)
    return np.stack([(weights[side] * (shape.faces[side] == vertex[:, None])).sum(1) for side in sides])


def _curvature_laplacian_rows(shape: Shape, weights: Floats) -> sparse.csr_matrix:
    """One row per vertex inside: the Laplacian of div N, times the root of the vertex's area."""
    count = len(shape.vertices)
    mass = lumped_mass(triangle_areas(shape.vertices[shape.faces]), shape.faces, count)
    i, j, edges = shape.edges.start, shape.edges.end, shape.edges
    tips = ((edges.left, edges.left_tip), (edges.right, edges.right_tip))
    weight = sum((weights[side] * (shape.faces[side] == tip[:, None])).sum(1) for side, tip in tips)
    inside = ~(shape.open_boundary[i] | shape.open_boundary[j])
    weight = np.maximum(weight, SMALLEST_WEIGHT) * inside
    values = np.concatenate([weight, weight, -weight, -weight])
    stiffness = sparse.csr_matrix(
        (values, (np.concatenate([i, j, i, j]), np.concatenate([j, i, i, j]))), (count, count)
    )
    root = sparse.diags(np.where(shape.open_boundary, 0.0, 1 / np.sqrt(mass)))
    return sparse.csr_matrix(root @ stiffness @ sparse.diags(1 / mass) @ _divergence_rows(shape))


def _divergence_rows(shape: Shape) -> sparse.csr_matrix:
    """One row per vertex: the integral of div N over its area, 2 H on a smooth surface."""
    corners, faces, count = shape.vertices[shape.faces], shape.faces, len(shape.vertices)
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    facing = normalised(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    gradient = np.cross(facing[:, None], opposite) / 6  # of the hat functions, times a third of the area
    values = np.broadcast_to(gradient[:, None], (len(faces), 3, 3, 3)).ravel()
    rows = np.repeat(faces.ravel(), 9)
    columns = np.broadcast_to(3 * faces[:, None, :, None] + np.arange(3), (len(faces), 3, 3, 3)).ravel()
    return sparse.csr_matrix((values, (rows, columns)), (count, 3 * count))
