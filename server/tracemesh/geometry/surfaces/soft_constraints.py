"""Network positions as soft constraints, for noisy networks (thesis section 4.5.4, Eq. 4.24-4.26).

Minimises  integral |L V - H|^2 dA + 1/length^3 integral |V - X|^2 ds  over all vertices, the network's included.
Integrals
instead of the thesis's sums make the length (m) a property of the surface: wiggles of the curves shorter than about 2
pi
lengths are smoothed away, whatever the mesh.
"""

import numpy as np
from scipy import sparse

from tracemesh.geometry.factorisation import Factorisation
from tracemesh.geometry.network import CurveNetwork, Floats, Ints
from tracemesh.geometry.surfaces.curvature import mean_curvature
from tracemesh.geometry.surfaces.edges import boundary_vertices
from tracemesh.geometry.surfaces.laplacian import Laplacian


def softened_points(
    network: CurveNetwork, laplacian: Laplacian, faces: Ints, vertices: Floats, normals: Floats, length: float
) -> Floats:
    """(k, 3) m, positions of the network's points on a surface that may leave them.

    laplacian, vertices, normals: of a surface (n, 3) through the network, whose points come first. length: m.
    """
    open_boundary = boundary_vertices(faces, len(vertices))
    weight = sparse.diags(np.where(open_boundary, 0.0, 1 / laplacian.mass))
    data = np.zeros(len(vertices))
    data[: len(network.points)] = _length_per_point(network) / length**3
    curvature = (-2 * mean_curvature(vertices, faces, normals) * laplacian.mass)[:, None] * normals
    matrix = laplacian.stiffness @ weight @ laplacian.stiffness + sparse.diags(data)
    right = laplacian.stiffness @ (weight @ curvature) + data[:, None] * vertices
    factor = Factorisation(matrix)
    return np.asarray(factor.solve(right)[: len(network.points)])


def _length_per_point(network: CurveNetwork) -> Floats:
    """(k,) m of curve that every point of the network stands for."""
    total = np.zeros(len(network.points))
    for segment in network.segments:
        half = np.linalg.norm(np.diff(network.points[segment.points], axis=0), axis=1) / 2
        np.add.at(total, segment.points[:-1], half)
        np.add.at(total, segment.points[1:], half)
    return total
