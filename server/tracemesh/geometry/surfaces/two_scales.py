"""Refinement of large meshes: found over a thinned network, then carried to the mesh itself.

What the refinement changes is smooth, and its factorisation grows faster than the mesh. Over every k-th point of the
network it costs the same whatever the mesh size. The mesh then takes from that coarse surface what is longer than the
coarse triangles, and from its own linear solution what is shorter:

    minimise  integral |L d|^2 + 1/length^4 integral |d - c|^2

for the displacement d along the normals, with c that from the linear to the coarse surface and d = 0 on the network;
the same for the normals. Meshes of moderate size are then refined themselves, from this start, in a step or two.

Rejected: carrying the change of curvature instead of position (networks of many curves gain nothing, because the linear
solve for a given curvature has an error of its own).
"""

from dataclasses import dataclass, replace

import numpy as np

from tracemesh.errors import SurfaceError
from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.network import Floats
from tracemesh.geometry.surfaces.biharmonic import BiharmonicSolver
from tracemesh.geometry.surfaces.cell_complex import CellComplex
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.edges import boundary_vertices
from tracemesh.geometry.surfaces.laplacian import surface_laplacian, triangle_areas
from tracemesh.geometry.surfaces.linear_surface import REBUILDS
from tracemesh.geometry.surfaces.patches import PatchMesh
from tracemesh.geometry.surfaces.refinement import Refined, refine, untrusted
from tracemesh.geometry.surfaces.subdivision import thinned
from tracemesh.geometry.surfaces.surface_stages import Stages, SurfaceParameters, linear_patches, settled
from tracemesh.geometry.vectors import corner_sum, dot

COARSE = 1200  # vertices of the thinned network's mesh, about
COARSE_PER_PATCH = 40  # and not fewer per patch
SMALL = 1500  # vertices up to which a mesh is refined without a thinned network
LARGEST_REFINED = 5000  # vertices up to which a mesh is also refined itself
LENGTH = 0.5  # beyond which the coarse surface counts, in its mesh sizes


@dataclass(frozen=True)
class _Coarse:
    """Patches over a thinned network and their refined surface."""

    patches: PatchMesh
    surface: Refined


def solved_surface(
    complex_: CellComplex, patches: PatchMesh, flat: Floats, parameters: SurfaceParameters, stages: Stages
) -> tuple[Floats, Floats, dict[str, object]]:
    """Vertices and normals, refined if that is wanted and convincing, and what the report says about it.

    flat: (n, 3) m, vertices of a first surface.
    """
    mode, every = parameters.refinement, _thinning(patches)
    report: dict[str, object] = {"mode": mode, "used": False}
    if mode == "off" or patches.count == patches.fixed:
        return *settled(complex_, patches, flat, stages), report
    if every == 1:
        vertices, normals = settled(complex_, patches, flat, stages)
        stages.begin("refinement", 0.7)
        refined = refine(vertices, normals, patches.faces, patches.patch, patches.fixed)
    else:
        stages.begin("refinement", 0.5)
        try:
            coarse = _coarse_surface(complex_, flat[: len(complex_.network.points)], parameters, every)
        except SurfaceError as error:
            reason = f"over every {every}th point of the network, {error}"
            return *settled(complex_, patches, flat, stages), report | {"skipped": reason}
        wanted = mode == "on" or coarse.surface.convincing
        vertices, normals = settled(complex_, patches, flat, stages, REBUILDS - wanted)
        stages.begin("refinement", 0.7)
        refined = _following(coarse, patches, vertices, normals) if wanted else coarse.surface
    report["evidence"] = refined.evidence
    if mode == "auto" and not refined.convincing:
        return vertices, normals, report
    return refined.vertices, refined.normals, report | {"used": True}


def _thinning(patches: PatchMesh) -> int:
    """Which points of the network the coarse mesh uses: every k-th; 1 if the mesh is small."""
    if patches.count <= SMALL:
        return 1
    wanted = max(COARSE, COARSE_PER_PATCH * (int(patches.patch.max()) + 1))
    return max(1, round(float(np.sqrt(patches.count / wanted))))


def _coarse_surface(complex_: CellComplex, points: Floats, parameters: SurfaceParameters, every: int) -> _Coarse:
    """The refined surface over every k-th point of a network with other positions (k, 3)."""
    network = thinned(replace(complex_.network, points=points), every)
    size = None if parameters.mesh_size is None else every * parameters.mesh_size
    patches, *linear = linear_patches(complex_.resampled(network), SurfaceParameters(size), Stages(None))
    return _Coarse(patches, refine(linear[0], linear[1], patches.faces, patches.patch, patches.fixed))


def _following(coarse: _Coarse, patches: PatchMesh, vertices: Floats, normals: Floats) -> Refined:
    """A surface that follows the coarse one, refined itself if it is not too large."""
    mesh, surface = coarse.patches, coarse.surface
    towards = _sampled(surface, mesh, patches, vertices, normals)
    length = LENGTH * float(np.sqrt(triangle_areas(surface.vertices[mesh.faces]).mean() * 4 / np.sqrt(3)))
    moved, turned = _blended(patches, vertices, normals, towards, length)
    kept = untrusted(patches.faces, patches.patch, (vertices, normals), (moved, turned))[:, None]
    moved, turned = np.where(kept, vertices, moved), np.where(kept, normals, turned)
    if patches.count > LARGEST_REFINED:
        return Refined(moved, turned, surface.evidence)
    fine = refine(moved, turned, patches.faces, patches.patch, patches.fixed)
    return Refined(fine.vertices, fine.normals, surface.evidence)


def _sampled(
    coarse: Refined, mesh: PatchMesh, patches: PatchMesh, vertices: Floats, normals: Floats
) -> tuple[Floats, Floats]:
    """Distance (n,) along the normals from a surface (n, 3) to a coarse one of the same patches, and its normals there.

    Between its vertices the coarse surface is half the triangle and half the mean of its corners' tangent planes there,
    which is exact where it is quadratic.
    """
    away, turned = np.zeros(len(vertices)), normals.copy()
    for number in range(int(patches.patch.max()) + 1):
        faces = mesh.faces[mesh.patch == number]
        own = np.setdiff1d(patches.faces[patches.patch == number], np.arange(patches.fixed))
        weight, _, face = ClosestPoints(coarse.vertices, faces)(vertices[own])
        corner, facing = coarse.vertices[faces[face]], coarse.normals[faces[face]]
        flat = corner_sum(corner * weight[..., None])
        height = dot(corner - flat[:, None], facing)  # of the tangent planes over the triangle
        point = flat + 0.5 * corner_sum(facing * (height * weight)[..., None])
        away[own] = dot(point - vertices[own], normals[own])
        turned[own] = normalised(corner_sum(facing * weight[..., None]))
    return away, turned


def _blended(
    patches: PatchMesh, vertices: Floats, normals: Floats, towards: tuple[Floats, Floats], length: float
) -> tuple[Floats, Floats]:
    """Vertices and normals that follow a coarse surface over more than a length, m, and the one given over less."""
    laplacian, faces = surface_laplacian(vertices, patches.faces), patches.faces
    pull = laplacian.mass / length**4
    away, turned = towards
    wanted = np.column_stack([away, turned - normals])
    solver = BiharmonicSolver(laplacian, patches.fixed, boundary_vertices(faces, patches.count), pull)
    change = solver.solve(np.zeros((patches.fixed, 4)), pulled_to=wanted)
    return vertices + change[:, :1] * normals, normalised(normals + change[:, 1:])
