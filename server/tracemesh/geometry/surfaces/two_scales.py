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

from dataclasses import replace

import numpy as np

from tracemesh.errors import SurfaceError
from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.network import Floats
from tracemesh.geometry.surfaces.biharmonic import BiharmonicSolver
from tracemesh.geometry.surfaces.cell_complex import CellComplex
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.edges import boundary_vertices
from tracemesh.geometry.surfaces.laplacian import surface_laplacian, triangle_areas
from tracemesh.geometry.surfaces.patches import PatchMesh
from tracemesh.geometry.surfaces.refinement import Refined, refine, untrusted
from tracemesh.geometry.surfaces.subdivision import thinned
from tracemesh.geometry.surfaces.surface_stages import Stages, SurfaceParameters, linear_patches

COARSE = 1200  # vertices of the thinned network's mesh, about
COARSE_PER_PATCH = 40  # and not fewer per patch
SMALL = 1500  # vertices up to which a mesh is refined without a thinned network
LARGEST_REFINED = 5000  # vertices up to which a mesh is also refined itself
LENGTH = 0.5  # beyond which the coarse surface counts, in its mesh sizes


def refined_surface(
    complex_: CellComplex,
    patches: PatchMesh,
    vertices: Floats,
    normals: Floats,
    parameters: SurfaceParameters,
    stages: Stages,
) -> tuple[Floats, Floats, dict[str, object]]:
    """Vertices and normals, refined if that is wanted and convincing, and what the report says about it."""
    mode = parameters.refinement
    report: dict[str, object] = {"mode": mode, "used": False}
    if mode == "off" or patches.count == patches.fixed:
        return vertices, normals, report
    stages.begin("refinement", 0.5)
    every = _thinning(patches)
    if every == 1:
        refined = refine(vertices, normals, patches.faces, patches.patch, patches.fixed)
    else:
        try:
            refined = _through_coarse(complex_, patches, vertices, normals, parameters, every)
        except SurfaceError as error:
            return vertices, normals, report | {"skipped": f"over every {every}th point of the network: {error}"}
    report |= {"evidence": refined.evidence}
    if mode == "auto" and not refined.convincing:
        return vertices, normals, report
    return refined.vertices, refined.normals, report | {"used": True}


def _thinning(patches: PatchMesh) -> int:
    """Which points of the network the coarse mesh uses: every k-th; 1 if the mesh is small."""
    if patches.count <= SMALL:
        return 1
    wanted = max(COARSE, COARSE_PER_PATCH * (int(patches.patch.max()) + 1))
    return max(1, round(float(np.sqrt(patches.count / wanted))))


def _through_coarse(
    complex_: CellComplex,
    patches: PatchMesh,
    vertices: Floats,
    normals: Floats,
    parameters: SurfaceParameters,
    every: int,
) -> Refined:
    """The surface that a refined one over every k-th point of the network leads to, and the evidence for that one."""
    network = thinned(replace(complex_.network, points=vertices[: len(complex_.network.points)]), every)
    size = None if parameters.mesh_size is None else every * parameters.mesh_size
    mesh, points, facing = linear_patches(complex_.resampled(network), SurfaceParameters(size), Stages(None))
    coarse = refine(points, facing, mesh.faces, mesh.patch, mesh.fixed)
    if not coarse.convincing and parameters.refinement == "auto":
        return Refined(vertices, normals, coarse.evidence)
    towards = _sampled(coarse, mesh, patches, vertices, normals)
    length = LENGTH * float(np.sqrt(triangle_areas(coarse.vertices[mesh.faces]).mean() * 4 / np.sqrt(3)))
    moved, turned = _blended(patches, vertices, normals, towards, length)
    kept = untrusted(patches.faces, patches.patch, (vertices, normals), (moved, turned))[:, None]
    moved, turned = np.where(kept, vertices, moved), np.where(kept, normals, turned)
    if patches.count <= LARGEST_REFINED:
        fine = refine(moved, turned, patches.faces, patches.patch, patches.fixed)
        moved, turned = fine.vertices, fine.normals
    return Refined(moved, turned, coarse.evidence)


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
        flat = (corner * weight[..., None]).sum(1)
        height = ((corner - flat[:, None]) * facing).sum(2, keepdims=True)  # of the tangent planes over the triangle
        point = flat + 0.5 * (height * facing * weight[..., None]).sum(1)
        away[own] = ((point - vertices[own]) * normals[own]).sum(1)
        turned[own] = normalised((facing * weight[..., None]).sum(1))
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
