"""A smooth surface spanned over a curve network: interpolates its points and normals (thesis chapter 4)."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from time import perf_counter

from tracemesh.geometry.biharmonic import BiharmonicSolver
from tracemesh.geometry.cell_complex import cell_complex
from tracemesh.geometry.curvature import mean_curvature, normalised
from tracemesh.geometry.laplacian import Laplacian, cotangent_laplacian, intrinsic_delaunay_laplacian
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork, Floats
from tracemesh.geometry.patches import PatchMesh, triangulate_patches
from tracemesh.geometry.quality import boundary_vertices, mesh_quality

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class SurfaceParameters:
    """mesh_size: m, edge length inside the patches; None takes the network's own spacing. rebuilds: solves in the
    metric of the last one.
    """

    mesh_size: float | None = None
    rebuilds: int = 2


@dataclass(frozen=True)
class SurfaceResult:
    """mesh: the surface, the network's points first. report: sizes, quality, stage times (s) and warnings, ready for
    JSON.
    """

    mesh: Mesh
    report: dict[str, object]


def span_surface(
    network: CurveNetwork, parameters: SurfaceParameters | None = None, progress: Progress | None = None
) -> SurfaceResult:
    """Span a surface over a network.

    progress(stage, fraction) is called between stages and may raise Cancelled. Raises NetworkError if the curves do not
    form a
    cell complex and SurfaceError if a patch cannot be meshed; both name the segment.
    """
    parameters = parameters or SurfaceParameters()
    stages = _Stages(progress)
    stages.begin("cycles", 0.0)
    complex_ = cell_complex(network)
    stages.begin("patches", 0.1)
    patches = triangulate_patches(network, complex_, parameters.mesh_size)
    stages.begin("surface", 0.2)
    vertices, normals = _solve(network, patches, None)
    for step in range(parameters.rebuilds):
        stages.begin("rebuild", 0.4 + 0.6 * step / parameters.rebuilds)
        vertices, normals = _solve(network, patches, vertices)
    stages.end()
    curvature = mean_curvature(vertices, patches.faces, normals)
    mesh = Mesh(vertices, patches.faces, normals, curvature, patches.patch)
    warnings = ["no curve was marked as boundary: found it"] if complex_.inferred else []
    quality = asdict(mesh_quality(vertices, patches.faces, normals))
    report = {**quality, "patches": len(complex_.faces), "stage_times": stages.times, "warnings": warnings}
    return SurfaceResult(mesh, report)


def _solve(network: CurveNetwork, patches: PatchMesh, last: Floats | None) -> tuple[Floats, Floats]:
    """Vertices and normals of one linear solve, in the metric of the planar patches or of the last solution."""
    laplacian = _laplacian(patches, last)
    open_boundary = boundary_vertices(patches.faces, patches.count)
    solver = BiharmonicSolver(laplacian, patches.fixed, open_boundary)
    base = solver.solve(network.points)
    normals = normalised(solver.solve(network.normals))
    curvature = mean_curvature(base, patches.faces, normals)
    target = (-2 * curvature * laplacian.mass)[:, None] * normals
    return solver.solve(network.points, target), normals


def _laplacian(patches: PatchMesh, last: Floats | None) -> Laplacian:
    if last is None:
        return cotangent_laplacian(patches.flat, patches.faces, patches.count)
    return intrinsic_delaunay_laplacian(last, patches.faces)


class _Stages:
    """Tells progress and keeps the time that every stage took."""

    def __init__(self, progress: Progress | None) -> None:
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
