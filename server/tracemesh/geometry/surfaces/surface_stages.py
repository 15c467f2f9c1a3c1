"""The stages in which a surface is spanned, for `span_surface` and `SurfaceSolver`."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Literal

import numpy as np

from tracemesh.errors import SurfaceError
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork, Floats
from tracemesh.geometry.surfaces.cell_complex import CellComplex, cell_complex, segment_name
from tracemesh.geometry.surfaces.curvature import extended_to_boundary, gaussian_curvature, mean_curvature
from tracemesh.geometry.surfaces.edges import boundary_vertices
from tracemesh.geometry.surfaces.laplacian import cotangent_laplacian, surface_laplacian
from tracemesh.geometry.surfaces.linear_surface import REBUILDS, linear_surface, rebuilt_surface, settled_surface
from tracemesh.geometry.surfaces.patches import PatchMesh, nearly_flat, triangulate_patches, unrolled_well
from tracemesh.geometry.surfaces.quality import inverted_faces, mesh_quality
from tracemesh.geometry.surfaces.soft_constraints import softened_points
from tracemesh.geometry.surfaces.subdivision import graded, subdivided

Progress = Callable[[str, float], None]
COARSE = 3.0  # edges inside the patches of the first solve, which only serves to unroll them, over those of the mesh
LARGEST_UNROLLS = 4
UNROLLED_ANGLE = 20.0  # degrees that are enough for a triangle, whatever it had in the plane
FARTHEST = 2.0  # distance of a vertex from the middle of the network, over its diagonal


@dataclass(frozen=True)
class SurfaceParameters:
    """How to span a surface.

    mesh_size: m, edge length inside the patches; None takes the network's own spacing. refinement: "auto" refines
    where the network gives evidence for it, "on" always, "off" keeps the linear solution, which is faster.
    soft: length over which the network's positions are smoothed, in its own edge lengths; 2 suits a noisy network, None
    interpolates the points.
    """

    mesh_size: float | None = None
    soft: float | None = None
    refinement: Literal["auto", "on", "off"] = "auto"


@dataclass(frozen=True)
class SurfaceResult:
    """mesh: the surface, the network's points first. report: sizes, quality, stage times (s), warnings, ready
    for JSON.
    """

    mesh: Mesh
    report: dict[str, object]


class Stages:
    """Tells progress and keeps the time that every stage took."""

    def __init__(self, progress: Progress | None) -> None:
        """progress: called at the begin of every stage; may raise to stop the work."""
        self._progress = progress
        self._name = ""
        self._begun = perf_counter()
        self.times: dict[str, float] = {}

    def begin(self, name: str, fraction: float) -> None:
        """End the stage before and begin another one; the same name adds up."""
        self._book()
        self._name, self._begun = name, perf_counter()
        if self._progress:
            self._progress(name, fraction)

    def end(self) -> None:
        """End the last stage."""
        self._book()
        if self._progress:
            self._progress("done", 1.0)

    def _book(self) -> None:
        if self._name:
            self.times[self._name] = self.times.get(self._name, 0.0) + perf_counter() - self._begun


def prepared(network: CurveNetwork, parameters: SurfaceParameters, stages: Stages) -> CellComplex:
    """The cell complex of a network, its edges evened and as fine as wanted. Raises NetworkError."""
    stages.begin("cycles", 0.0)
    complex_ = cell_complex(network)
    finer = graded(complex_.network)
    if parameters.mesh_size is not None:
        finer = subdivided(finer, parameters.mesh_size)
    return complex_ if finer is complex_.network else complex_.resampled(finer)


def finished(
    complex_: CellComplex,
    patches: PatchMesh,
    vertices: Floats,
    normals: Floats,
    refinement: dict[str, object],
    stages: Stages,
) -> SurfaceResult:
    """Mesh and report. vertices: (n, 3) m. normals: (n, 3). refinement: what the report says about it."""
    stages.end()
    faces, boundary = patches.faces, boundary_vertices(patches.faces, patches.count)
    curvature = extended_to_boundary(mean_curvature(vertices, faces, normals), faces, boundary)
    mesh = Mesh(vertices, faces, normals, curvature, gaussian_curvature(vertices, faces, normals), patches.patch)
    return SurfaceResult(mesh, _report(mesh, complex_, stages) | {"refinement": refinement})


def linear_patches(
    complex_: CellComplex, parameters: SurfaceParameters, stages: Stages
) -> tuple[PatchMesh, Floats, Floats]:
    """Patches, vertices (n, 3), m, and normals (n, 3) of the linear surface."""
    patches, flat = unrolled_patches(complex_, parameters, stages)
    return patches, *settled(complex_, patches, flat, stages)


def unrolled_patches(complex_: CellComplex, parameters: SurfaceParameters, stages: Stages) -> tuple[PatchMesh, Floats]:
    """Patches and vertices (n, 3), m: over projected patches, then, unless all are nearly flat, over these unrolled."""
    points, normals = complex_.network.points, complex_.network.normals
    last, trial = None, not nearly_flat(complex_)
    for attempt in range(LARGEST_UNROLLS + 1):
        stages.begin("patches", 0.1 + 0.05 * attempt)
        patches = triangulate_patches(complex_, parameters.mesh_size, COARSE if trial else 1.0, last)
        stages.begin("surface", 0.12 + 0.05 * attempt)
        vertices, spread = surface_over(complex_, patches)
        if not trial:
            if unrolled_well(patches, vertices, spread, UNROLLED_ANGLE):
                break
            vertices, spread = rebuilt_surface(vertices, patches.faces, points, normals, patches.lift)
        last, trial = (patches, vertices), False
    if parameters.soft is not None:
        points = _softened(complex_.network, patches, vertices, spread, parameters.soft)
        vertices = np.vstack([points, vertices[len(points) :]])
    return patches, vertices


def surface_over(complex_: CellComplex, patches: PatchMesh) -> tuple[Floats, Floats]:
    """Vertices (n, 3), m, and normals (n, 3) in the metric of the plane that every patch lies in."""
    network = complex_.network
    flat = cotangent_laplacian(patches.planar[patches.planar_faces], patches.faces, patches.count)
    return linear_surface(flat, patches.faces, network.points, network.normals, patches.lift)


def settled(
    complex_: CellComplex, patches: PatchMesh, flat: Floats, stages: Stages, rebuilds: int = REBUILDS
) -> tuple[Floats, Floats]:
    """Vertices (n, 3), m, and normals (n, 3) of the linear surface that a first one, flat (n, 3), leads to.

    Raises SurfaceError if a patch is lost.
    """
    stages.begin("rebuild", 0.6)
    normals = complex_.network.normals
    vertices, spread = settled_surface(flat, patches.faces, normals, patches.lift, rebuilds)
    _check_spread(complex_, patches, vertices, spread)
    return vertices, spread


def _check_spread(complex_: CellComplex, patches: PatchMesh, vertices: Floats, normals: Floats) -> None:
    """Raise SurfaceError for a patch most of whose triangles are turned over: its boundary says too little
    about its inside.
    """
    away = np.linalg.norm(vertices - complex_.network.points.mean(0), axis=1)
    lost = ~(away < FARTHEST * complex_.network.diagonal)[patches.faces].all(1)
    bad = inverted_faces(vertices, patches.faces, normals) | lost
    share = np.bincount(patches.patch, bad) / np.bincount(patches.patch)
    if share.max() > 0.5:
        corner = patches.vertex[patches.starts[int(share.argmax())]]
        number = next(k for k, s in enumerate(complex_.network.segments) if corner in s.points)
        name = segment_name(complex_.network, number)
        raise SurfaceError(f"the patch beside {name} folds over: add a curve across it")


def _softened(network: CurveNetwork, patches: PatchMesh, vertices: Floats, normals: Floats, soft: float) -> Floats:
    """Positions of the network's points that the surface would rather have."""
    edges = [np.linalg.norm(np.diff(network.points[s.points], axis=0), axis=1) for s in network.segments]
    laplacian = surface_laplacian(vertices, patches.faces)
    return softened_points(network, laplacian, patches.faces, vertices, normals, soft * np.concatenate(edges).mean())


def _report(mesh: Mesh, complex_: CellComplex, stages: Stages) -> dict[str, object]:
    quality = mesh_quality(mesh.vertices, mesh.faces, mesh.normals)
    warnings = ["no curve was marked as boundary: found it from the turning of the curves"] if complex_.inferred else []
    if quality.inverted_faces:
        warnings.append(f"{quality.inverted_faces} triangles are turned over: the network may need another curve there")
    return {**asdict(quality), "patches": int(mesh.patch.max()) + 1, "seconds": stages.times, "warnings": warnings}
