"""The linear solve for positions and normals of a triangulated network (thesis section 4.5)."""

import numpy as np

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.biharmonic import BiharmonicSolver
from tracemesh.geometry.surfaces.curvature import mean_curvature, normalised
from tracemesh.geometry.surfaces.edges import boundary_vertices
from tracemesh.geometry.surfaces.laplacian import Laplacian, surface_laplacian


def linear_surface(
    laplacian: Laplacian, faces: Ints, points: Floats, normals: Floats, lift: Floats
) -> tuple[Floats, Floats]:
    """Vertices and unit normals (n, 3) that interpolate the leading ones.

    laplacian: of n vertices, in the best metric known so far. faces: (f, 3). points, normals: (fixed, 3) of the leading
    vertices.
    Raises SurfaceError if they do not determine the rest.
    """
    solver = BiharmonicSolver(laplacian, len(points), boundary_vertices(faces, len(laplacian.mass)))
    base, spread = np.hsplit(solver.solve(np.hstack([points, normals])), 2)
    spread = normalised(spread + np.sqrt(np.maximum(1 - (spread**2).sum(1, keepdims=True), 0)) * lift)
    target = (-2 * mean_curvature(base, faces, spread) * laplacian.mass)[:, None] * spread
    return solver.solve(points, target), spread


def rebuilt_surface(
    vertices: Floats, faces: Ints, points: Floats, normals: Floats, lift: Floats
) -> tuple[Floats, Floats]:
    """The same in the metric of a surface (n, 3) found before: planar patches measure lengths and angles too short."""
    return linear_surface(surface_laplacian(vertices, faces), faces, points, normals, lift)
