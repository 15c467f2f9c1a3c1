"""Triangulation of every patch of a network in a plane (thesis section 4.4.2)."""

from dataclasses import dataclass

import numpy as np

from tracemesh.errors import SurfaceError
from tracemesh.geometry.cell_complex import CellComplex, segment_name
from tracemesh.geometry.curvature import normalised
from tracemesh.geometry.cycles import Cycle
from tracemesh.geometry.flattening import flatten
from tracemesh.geometry.network import CurveNetwork, Floats, Ints
from tracemesh.geometry.quality import inverted_faces, triangle_angles
from tracemesh.geometry.triangulation import triangulate_polygon

SMALLEST_AVERAGE = 0.1  # length of the mean of unit normals below which its direction says nothing


@dataclass(frozen=True)
class PatchMesh:
    """Triangulation of all patches, without positions of the interior vertices.

    planar: (p, 2) m, every patch in its own plane: its boundary, then its interior points. planar_faces: (f, 3) indices
    into
    planar. vertex: (p,) the mesh vertex of a planar point; the first `fixed` of `count` vertices are the network's
    points.
    patch: (f,) number of the face's cycle. starts: (number of cycles,) first planar point of every patch.
    """

    planar: Floats
    planar_faces: Ints
    vertex: Ints
    patch: Ints
    starts: Ints
    fixed: int
    count: int

    @property
    def faces(self) -> Ints:
        """(f, 3) indices of mesh vertices."""
        return self.vertex[self.planar_faces]


def triangulate_patches(
    complex_: CellComplex, spacing: float | None, coarsening: float, last: tuple[PatchMesh, Floats] | None = None
) -> PatchMesh:
    """Triangulate every face of a cell complex.

    spacing: edge length inside, m; None takes each patch's own boundary spacing. coarsening: factor on it. last: a
    triangulation with vertices
    (n, 3)
    whose patches are unrolled to be triangulated again; None projects along average normals.
    """
    network = complex_.network
    unrolled = None if last is None else _unrolled_loops(complex_, *last)
    fixed = count = len(network.points)
    planar, faces, vertex, patch, starts = [], [], [], [], []
    begin = 0
    for number, cycle in enumerate(complex_.faces):
        loop, inside, triangles = _triangulate(network, cycle, spacing, coarsening, unrolled and unrolled[number])
        planar += [loop, inside]
        faces.append(triangles + begin)
        vertex += [cycle.points, count + np.arange(len(inside))]
        patch.append(np.full(len(triangles), number))
        starts.append(begin)
        count += len(inside)
        begin += len(loop) + len(inside)
    return PatchMesh(
        np.vstack(planar),
        np.vstack(faces),
        np.concatenate(vertex),
        np.concatenate(patch),
        np.array(starts),
        fixed,
        count,
    )


def unrolled_well(patches: PatchMesh, vertices: Floats, normals: Floats) -> bool:
    """Whether triangles in space are nearly as well shaped as in the plane, and none is turned over. vertices:
    (n, 3).
    """
    flat = np.column_stack([patches.planar, np.zeros(len(patches.planar))])
    in_plane = triangle_angles(flat, patches.planar_faces).min(1)
    in_space = triangle_angles(vertices, patches.faces).min(1)
    enough = np.minimum(0.75 * in_plane, np.radians(20))
    return bool((in_space >= enough).all()) and not inverted_faces(vertices, patches.faces, normals).any()


def _unrolled_loops(complex_: CellComplex, patches: PatchMesh, vertices: Floats) -> list[Floats]:
    """Boundaries of all patches, unrolled from space into the plane."""
    planar = flatten(vertices[patches.vertex], patches.planar_faces, patches.planar, patches.starts)
    return [planar[start : start + len(c.points)] for start, c in zip(patches.starts, complex_.faces, strict=True)]


def _triangulate(
    network: CurveNetwork, cycle: Cycle, spacing: float | None, coarsening: float, unrolled: Floats | None
) -> tuple[Floats, Floats, Ints]:
    """Loop in the plane, interior points and faces of one patch; the first map to the plane that is injective."""
    points, normals = network.points[cycle.points], network.normals[cycle.points]
    size = spacing or float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).mean())
    for loop in (unrolled, project_to_plane(points, normals), map_to_circle(points)):
        try:
            if loop is not None and signed_area(loop) > 0:
                return loop, *triangulate_polygon(loop, size * coarsening)
        except SurfaceError:
            continue
    raise SurfaceError(f"the patch beside {segment_name(network, cycle.sides[0].segment)} cannot be triangulated")


def project_to_plane(points: Floats, normals: Floats) -> Floats | None:
    """(k, 2) m, projection along the average normal; None if that vanishes. points, normals: (k,
    3).
    """
    average = normals.mean(0)
    if np.linalg.norm(average) < SMALLEST_AVERAGE:
        return None
    normal = normalised(average)
    offset = points - points.mean(0)
    offset -= np.outer(offset @ normal, normal)
    distance = np.linalg.norm(offset, axis=1)
    # An axis that turns with the loop, and does not flicker between corners that are equally far.
    first = normalised(offset[np.argmax(distance > (1 - 1e-6) * distance.max())])
    return np.asarray(offset @ np.column_stack([first, np.cross(normal, first)]))


def map_to_circle(points: Floats) -> Floats:
    """(k, 2) m, the loop laid on a circle of its own length. points: (k, 3)."""
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    angle = 2 * np.pi * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()
    return np.asarray(np.column_stack([np.cos(angle), np.sin(angle)]) * steps.sum() / (2 * np.pi))


def signed_area(loop: Floats) -> float:
    """m^2, positive for a counter-clockwise loop (k, 2)."""
    x, y = loop.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
