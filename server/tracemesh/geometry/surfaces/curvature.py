"""Mean and Gaussian curvature from positions and propagated normals (thesis section 4.5.2, Eq. 4.18), with their signs.

The printed -|H| N bends every patch outwards; the component along the normal keeps saddles and hollows.
"""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.laplacian import lumped_mass, triangle_areas
from tracemesh.geometry.vectors import corner_sum, dot, lengths


def mean_curvature(vertices: Floats, faces: Ints, normals: Floats) -> Floats:
    """(n,) 1/m, mean of the principal curvatures, 1/r on a sphere of radius r with outward normals.

    vertices, normals: (n, 3). faces: (f, 3). The curvature vector -2 H N is the sum of (edge opposite of the vertex) x
    (mean normal of the face) over the faces around a vertex, over twice its mass. Not defined on an open boundary,
    where the sum lacks faces.
    """
    corners = vertices[faces]
    turned = normals[faces]
    facing = normalised(corner_sum(turned))
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    flux = 0.5 * dot(opposite, np.cross(facing[:, None], turned))
    total = np.bincount(faces.ravel(), flux.ravel(), len(vertices))
    return np.asarray(-0.5 * total / lumped_mass(triangle_areas(corners), faces, len(vertices)))


def gaussian_curvature(vertices: Floats, faces: Ints, normals: Floats) -> Floats:
    """(n,) 1/m^2, product of the principal curvatures, 1/r^2 on a sphere of radius r, negative on saddles.

    vertices, normals: (n, 3). faces: (f, 3). Gauss's definition: the area that the normals of the faces around a vertex
    sweep on the unit sphere, seen along the faces' own normals, over the area of these faces; also on an open boundary.
    The angle that a vertex lacks to 2 pi, over its area, does not converge where vertices have other than six edges.
    """
    corners, turned = vertices[faces], normals[faces]
    own = normalised(_spanned(corners))
    swept = 0.5 * dot(_spanned(turned), own)
    total = np.bincount(faces.ravel(), np.repeat(swept / 3, 3), len(vertices))
    return np.asarray(total / lumped_mass(triangle_areas(corners), faces, len(vertices)))


def sphere_normals(vertices: Floats, faces: Ints) -> Floats:
    """(n, 3) unit normals of a mesh from its positions alone, exact where vertices lie on a sphere (Max 1999).

    vertices: (n, 3). faces: (f, 3). Each face's cross product counts over the squared lengths of the two edges beside.
    """
    edges = np.roll(vertices[faces], -1, axis=1) - vertices[faces]  # from every corner to the next
    behind = np.roll(edges, 1, axis=1)
    size = dot(edges, edges) * dot(behind, behind)
    share = np.cross(behind, edges) / size[..., None]
    return normalised(np.column_stack([np.bincount(faces.ravel(), share[..., k].ravel()) for k in range(3)]))


def _spanned(corners: Floats) -> Floats:
    """(f, 3) cross products of two edges of triangles (f, 3, 3)."""
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def extended_to_boundary(values: Floats, faces: Ints, open_boundary: NDArray[np.bool_]) -> Floats:
    """(n,) values with those on the open boundary replaced by the mean of their neighbours', inside ones first.

    values, open_boundary: (n,). faces: (f, 3).
    """
    values, known = values.copy(), ~open_boundary
    start, end = (np.roll(faces, -k, axis=1).ravel() for k in range(2))
    one, other = np.concatenate([start, end]), np.concatenate([end, start])
    for _ in range(2):  # the tip of an acute corner has neighbours on the boundary only
        weight = np.bincount(one, known[other], len(values))
        mean = np.bincount(one, values[other] * known[other], len(values)) / np.maximum(weight, 1)
        new = ~known & (weight > 0)
        values[new], known = mean[new], known | new
    return values


def normalised(vectors: Floats) -> Floats:
    """(..., 3) unit vectors; a zero vector stays zero."""
    size = lengths(vectors)[..., None]
    return np.asarray(vectors / np.where(size > 0, size, 1.0))
