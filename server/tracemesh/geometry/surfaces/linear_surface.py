"""The linear solve for positions and normals of a triangulated network (thesis section 4.5)."""

import numpy as np

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.biharmonic import BiharmonicSolver
from tracemesh.geometry.surfaces.curvature import mean_curvature, normalised, sphere_normals
from tracemesh.geometry.surfaces.edges import boundary_vertices
from tracemesh.geometry.surfaces.laplacian import Laplacian, surface_laplacian
from tracemesh.geometry.vectors import dot

REBUILDS = 2  # solves in the metric of the last one; more change little


def linear_surface(
    laplacian: Laplacian, faces: Ints, points: Floats, normals: Floats, lift: Floats
) -> tuple[Floats, Floats]:
    """Vertices and unit normals (n, 3) that interpolate the leading ones.

    laplacian: of n vertices, in the best metric known so far. faces: (f, 3). points, normals: (fixed, 3) of the leading
    vertices.
    Raises SurfaceError if they do not determine the rest.
    """
    return _solved(laplacian, faces, points, normals, lift)[1:]


def rebuilt_surface(
    vertices: Floats, faces: Ints, points: Floats, normals: Floats, lift: Floats
) -> tuple[Floats, Floats]:
    """The same in the metric of a surface (n, 3) found before: planar patches measure lengths and angles too short."""
    return linear_surface(surface_laplacian(vertices, faces), faces, points, normals, lift)


def settled_surface(
    vertices: Floats, faces: Ints, normals: Floats, lift: Floats, rebuilds: int = REBUILDS
) -> tuple[Floats, Floats]:
    """Rebuilt until it changes little, with its own curvature matched to that of its normals; arguments as above.

    The first vertices, as many as there are normals (fixed, 3), stay. The others move along their normals only:
    sideways nothing holds them, and triangles would drift out of shape.
    """
    points = vertices[: len(normals)]
    for _ in range(rebuilds - 1):
        vertices, _, _ = _rebuilt_along_normals(vertices, faces, points, normals, lift)
    vertices, spread, solver = _rebuilt_along_normals(vertices, faces, points, normals, lift)
    short = _missing_curvature(vertices, faces, spread, len(points))
    more = solver.solve(np.zeros_like(points), (-2 * short * solver.mass)[:, None] * spread)
    return vertices + dot(more, spread)[:, None] * spread, spread


def _rebuilt_along_normals(
    vertices: Floats, faces: Ints, points: Floats, normals: Floats, lift: Floats
) -> tuple[Floats, Floats, BiharmonicSolver]:
    """Vertices moved along their normals to where one more solve puts them, the normals, and the solver."""
    solver, rebuilt, spread = _solved(surface_laplacian(vertices, faces), faces, points, normals, lift)
    moved = vertices + dot(rebuilt - vertices, spread)[:, None] * spread
    return np.vstack([points, moved[len(points) :]]), spread, solver


def _missing_curvature(vertices: Floats, faces: Ints, normals: Floats, fixed: int) -> Floats:
    """(n,) 1/m, mean curvature of the normals less that of the surface's own normals, by the same formula.

    The cotangent Laplacian of a smooth surface is not its curvature where triangles are irregular, so solving for it
    leaves a difference; normals of the network, the first `fixed`, count on both sides.
    """
    own = sphere_normals(vertices, faces)
    own[:fixed] = normals[:fixed]
    return mean_curvature(vertices, faces, normals) - mean_curvature(vertices, faces, own)


def _solved(
    laplacian: Laplacian, faces: Ints, points: Floats, normals: Floats, lift: Floats
) -> tuple[BiharmonicSolver, Floats, Floats]:
    """The solver, and the vertices and normals that it finds."""
    solver = BiharmonicSolver(laplacian, len(points), boundary_vertices(faces, len(laplacian.mass)))
    base, spread = np.hsplit(solver.solve(np.hstack([points, normals])), 2)
    spread = normalised(spread + np.sqrt(np.maximum(1 - dot(spread, spread)[:, None], 0)) * lift)
    target = (-2 * mean_curvature(base, faces, spread) * laplacian.mass)[:, None] * spread
    return solver, solver.solve(points, target), spread
