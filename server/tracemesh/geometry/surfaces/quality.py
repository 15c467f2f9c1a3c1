"""Figures that tell a good mesh from a bad one, for the report."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.edges import unique_edges
from tracemesh.geometry.vectors import corner_sum, dot, lengths


@dataclass(frozen=True)
class MeshQuality:
    """vertices, faces, euler_number, boundary_loops: counts. min_angle_deg, mean_angle_deg: of all triangles' smallest
    angles, degrees.

    inverted_faces: triangles that look more than 90 degrees away from the normals at their corners.
    """

    vertices: int
    faces: int
    euler_number: int
    boundary_loops: int
    min_angle_deg: float
    mean_angle_deg: float
    inverted_faces: int


def mesh_quality(vertices: Floats, faces: Ints, normals: Floats) -> MeshQuality:
    """Quality of a mesh. vertices, normals: (n, 3). faces: (f, 3)."""
    edges, count = unique_edges(faces)
    smallest = triangle_angles(vertices, faces).min(1)
    return MeshQuality(
        vertices=len(vertices),
        faces=len(faces),
        euler_number=len(np.unique(faces)) - len(edges) + len(faces),
        boundary_loops=_component_count(edges[count == 1]),
        min_angle_deg=float(np.degrees(smallest.min())),
        mean_angle_deg=float(np.degrees(smallest.mean())),
        inverted_faces=int(inverted_faces(vertices, faces, normals).sum()),
    )


def triangle_angles(vertices: Floats, faces: Ints) -> Floats:
    """(f, 3) rad, the angle at every corner."""
    corners = vertices[faces]
    to_next, to_last = np.roll(corners, -1, axis=1) - corners, np.roll(corners, -2, axis=1) - corners
    return np.asarray(np.arctan2(lengths(np.cross(to_next, to_last)), dot(to_next, to_last)))


def inverted_faces(vertices: Floats, faces: Ints, normals: Floats) -> NDArray[np.bool_]:
    """(f,) whether a face looks more than 90 degrees away from the sum of the normals at its corners."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(dot(np.cross(b - a, c - a), corner_sum(normals[faces])) <= 0)


def _component_count(edges: Ints) -> int:
    """Number of connected pieces of a graph without isolated vertices."""
    if not len(edges):
        return 0
    index, compact = np.unique(edges, return_inverse=True)
    pairs = compact.reshape(-1, 2)
    graph = sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(index), len(index)))
    return int(sparse.csgraph.connected_components(graph, directed=False)[0])
