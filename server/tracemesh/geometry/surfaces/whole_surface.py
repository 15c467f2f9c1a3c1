"""The surface of a whole network: its patches unrolled and solved, once more where that left triangles out of shape.

Steep patches with holes may be well unrolled from a first surface, and not fit the one that the solve then leads to.
"""

from tracemesh.errors import SurfaceError
from tracemesh.geometry.network import Floats
from tracemesh.geometry.surfaces.cell_complex import CellComplex
from tracemesh.geometry.surfaces.patches import PatchMesh, triangulate_patches, unrolled_well
from tracemesh.geometry.surfaces.quality import inverted_faces, triangle_angles
from tracemesh.geometry.surfaces.surface_stages import Stages, SurfaceParameters, surface_over, unrolled_patches
from tracemesh.geometry.surfaces.two_scales import solved_surface

SMALLEST_ANGLE = 15.0  # degrees that are enough for a triangle in the end

Solved = tuple[PatchMesh, Floats, Floats, dict[str, object]]
"""Patches, vertices (n, 3) m, normals (n, 3), and what the report says about the refinement."""


def whole_surface(complex_: CellComplex, parameters: SurfaceParameters, stages: Stages) -> Solved:
    """The surface over a cell complex. Raises SurfaceError, naming the patch, if there is none."""
    patches, flat = unrolled_patches(complex_, parameters, stages)
    found: Solved = (patches, *solved_surface(complex_, patches, flat, parameters, stages))
    if parameters.soft is not None or unrolled_well(*found[:3], SMALLEST_ANGLE):
        return found
    try:
        return max(found, _unrolled_again(complex_, found, parameters, stages), key=_rank)
    except SurfaceError:
        return found


def _unrolled_again(complex_: CellComplex, found: Solved, parameters: SurfaceParameters, stages: Stages) -> Solved:
    patches, vertices, *_ = found
    stages.begin("patches", 0.5)
    again = triangulate_patches(complex_, parameters.mesh_size, 1.0, (patches, vertices))
    stages.begin("surface", 0.55)
    flat, _ = surface_over(complex_, again)
    return (again, *solved_surface(complex_, again, flat, parameters, stages))


def _rank(solved: Solved) -> tuple[int, float]:
    """The fewer triangles turned over, then the larger the smallest angle, the better."""
    patches, vertices, normals, _ = solved
    turned = int(inverted_faces(vertices, patches.faces, normals).sum())
    return -turned, float(triangle_angles(vertices, patches.faces).min())
