"""Triangulation of every patch of a network in a plane (thesis section 4.4.2)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from tracemesh.errors import SurfaceError
from tracemesh.geometry.network import CurveNetwork, Floats, Ints
from tracemesh.geometry.surfaces.bridges import Outline, joined_outline, plain_outline
from tracemesh.geometry.surfaces.cell_complex import CellComplex, segment_name
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.edges import unique_edges
from tracemesh.geometry.surfaces.flattening import flatten, holes_filled
from tracemesh.geometry.surfaces.planar_maps import (
    SMALLEST_AVERAGE,
    develop,
    map_to_circle,
    parted,
    project_to_plane,
    signed_area,
    turned,
)
from tracemesh.geometry.surfaces.quality import inverted_faces, triangle_angles
from tracemesh.geometry.surfaces.triangulation import triangulate_polygon

FLAT = 0.9  # of an edge's length that its projection keeps, for a patch that need not be unrolled
LARGEST_STRETCH = 2.0  # of a boundary in the plane; more says that the surface it was unrolled from went astray


@dataclass(frozen=True)
class PatchMesh:
    """Triangulation of all patches, without positions of the interior vertices.

    planar: (p, 2) m, every patch in its own plane: its boundary, then its interior points. planar_faces: (f, 3) indices
    into
    planar. vertex: (p,) the mesh vertex of a planar point; the first `fixed` of `count` vertices are the network's
    points.
    patch: (f,) number of the face's cycle. starts: (number of cycles,) first planar point of every patch.
    lift: (count, 3) which way normals go inside patches whose boundary normals cancel out, like a hemisphere's; else 0.
    """

    planar: Floats
    planar_faces: Ints
    vertex: Ints
    patch: Ints
    starts: Ints
    lift: Floats
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

    spacing: edge length inside, m; None takes each patch's own boundary spacing. coarsening: factor on it.
    last: a triangulation with vertices (n, 3) whose patches are unrolled to be triangulated again; None projects along
    average normals. Raises SurfaceError, naming the patch, if one cannot be triangulated.
    """
    network, outlines = complex_.network, outlines_of(complex_)
    unrolled = [()] * len(outlines) if last is None else _unrolled_loops(outlines, *last)
    pieces = [
        _triangulate(network, outline, spacing, coarsening, loop)
        for outline, loop in zip(outlines, unrolled, strict=True)
    ]
    mesh = _numbered(outlines, pieces, len(network.points))
    _check_manifold(mesh.faces)
    return mesh


def _numbered(outlines: list[Outline], pieces: list[tuple[Floats, Floats, Ints]], fixed: int) -> PatchMesh:
    """Patches as one mesh: the network's points, then those of slits, then those inside of every patch."""
    count = max(fixed, 1 + max(int(outline.vertex.max()) for outline in outlines))
    inside = [len(points) for _, points, _ in pieces]
    size = [len(loop) + m for (loop, _, _), m in zip(pieces, inside, strict=True)]
    starts = np.concatenate([[0], np.cumsum(size)[:-1]])
    first = count + np.concatenate([[0], np.cumsum(inside)[:-1]])
    vertex = [np.append(o.vertex, k + np.arange(m)) for o, k, m in zip(outlines, first, inside, strict=True)]
    lift = [np.tile(_lift(o), (m, 1)) for o, m in zip(outlines, inside, strict=True)]
    return PatchMesh(
        planar=np.vstack([part for loop, points, _ in pieces for part in (loop, points)]),
        planar_faces=np.vstack([faces + k for (_, _, faces), k in zip(pieces, starts, strict=True)]),
        vertex=np.concatenate(vertex),
        patch=np.repeat(np.arange(len(pieces)), [len(faces) for _, _, faces in pieces]),
        starts=starts,
        lift=np.vstack([np.zeros((count, 3)), *lift]),
        fixed=fixed,
        count=count + sum(inside),
    )


def _check_manifold(faces: Ints) -> None:
    """Acute corners on both sides of a curve may be cut along the same chord."""
    edges, count = unique_edges(faces)
    if count.max() > 2:
        a, b = edges[count.argmax()]
        raise SurfaceError(
            f"the patches on both sides of points {a} and {b} of the network cut the same corner: add points"
        )


def _check_slits(outline: Outline, inside: int, faces: Ints) -> None:
    """Raise SurfaceError where triangles on both sides of a slit, whose points are the same, share more than its edges.

    inside: number of interior points. faces: (f, 3) into the outline's points, then those.
    """
    vertex = np.append(outline.vertex, int(outline.vertex.max()) + 1 + np.arange(inside))
    if unique_edges(vertex[faces])[1].max() > 2:
        raise SurfaceError("a slit between its loops is crossed")


def nearly_flat(complex_: CellComplex) -> bool:
    """Whether every patch keeps its shape when projected along its average normal, as far as its boundary tells."""
    for outline in outlines_of(complex_):
        loop = project_to_plane(outline.points, outline.normals)
        if loop is None or (_edge_lengths(loop) < FLAT * _edge_lengths(outline.points)).any():
            return False
    return True


def unrolled_well(patches: PatchMesh, vertices: Floats, normals: Floats, degrees: float) -> bool:
    """Whether triangles in space are nearly as well shaped as in the plane, or well enough, and none is turned over.

    vertices, normals: (n, 3). degrees: the smallest angle that is enough.
    """
    flat = np.column_stack([patches.planar, np.zeros(len(patches.planar))])
    in_plane = triangle_angles(flat, patches.planar_faces).min(1)
    in_space = triangle_angles(vertices, patches.faces).min(1)
    enough = np.minimum(0.75 * in_plane, np.radians(degrees))
    return bool((in_space >= enough).all()) and not inverted_faces(vertices, patches.faces, normals).any()


def outlines_of(complex_: CellComplex) -> list[Outline]:
    """Outline of every face; a face with several loops counts as the first of them."""
    network, outlines = complex_.network, []
    next_vertex = len(network.points)
    group_of = {number: group for group in complex_.groups for number in group}
    for number, cycle in enumerate(complex_.faces):
        group = group_of.get(number, (number,))
        if len(group) == 1:
            outlines.append(plain_outline(network, cycle))
        elif number == group[0]:
            outlines.append(joined_outline(network, [complex_.faces[k] for k in group], next_vertex))
            next_vertex = max(next_vertex, int(outlines[-1].vertex.max()) + 1)
    return outlines


def _perimeter(loop: Floats) -> float:
    """m, length of a closed polygon (k, 2 or 3)."""
    return float(_edge_lengths(loop).sum())


def _edge_lengths(loop: Floats) -> Floats:
    """(k,) m, of a closed polygon (k, 2 or 3)."""
    return np.asarray(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1))


def _lift(outline: Outline) -> Floats:
    """(3,) direction that the normals inside a patch take where those on its boundary cancel out: that of its area."""
    if np.linalg.norm(outline.normals.mean(0)) > SMALLEST_AVERAGE:
        return np.zeros(3)
    return normalised(np.cross(outline.points, np.roll(outline.points, -1, axis=0)).sum(0))


def _unrolled_loops(outlines: list[Outline], patches: PatchMesh, vertices: Floats) -> list[tuple[Floats, ...]]:
    """Boundaries of all patches, unrolled from space into the plane: with their slits sewn up, and cut open at them.

    A band opens as a cylinder does; around a hole in a dome the sides of a slit would cross, or all but do so.
    """
    open_ = flatten(vertices[patches.vertex], patches.planar_faces, patches.planar, patches.starts)
    ends = [slice(start, start + len(o.points)) for start, o in zip(patches.starts, outlines, strict=True)]
    patch = np.repeat(np.arange(len(outlines)), np.diff(np.append(patches.starts, len(patches.vertex))))
    _, first, place = np.unique(patch * patches.count + patches.vertex, return_index=True, return_inverse=True)
    if len(first) == len(patches.vertex):
        return [(open_[own],) for own in ends]
    sewn = holes_filled(
        vertices[patches.vertex[first]], place[patches.planar_faces], patches.planar[first], patch[first]
    )
    closed = flatten(*sewn, place[patches.starts])[place]
    return [_by_stretch(outline, closed[own], open_[own]) for outline, own in zip(outlines, ends, strict=True)]


def _by_stretch(outline: Outline, sewn: Floats, cut: Floats) -> tuple[Floats, Floats]:
    """Two maps (k, 2) of an outline, the better one first; being cut open is worth it where it halves the stretch."""
    length, least = _edge_lengths(outline.points), np.finfo(float).tiny
    stretch = [np.linalg.norm(np.log(np.maximum(_edge_lengths(loop) / length, least))) for loop in (sewn, cut)]
    return (cut, sewn) if stretch[1] < stretch[0] / 2 else (sewn, cut)


def _triangulate(
    network: CurveNetwork, outline: Outline, spacing: float | None, coarsening: float, unrolled: tuple[Floats, ...]
) -> tuple[Floats, Floats, Ints]:
    """Loop in the plane, interior points and faces of one patch; the first map to the plane that is injective."""
    points, normals = outline.points, outline.normals
    size = spacing or _perimeter(points) / len(points)
    reason = "its boundary turns the wrong way"
    whole = len(np.unique(outline.vertex)) == len(points)  # else its walk begins at a slit, wherever its curves do
    maps: tuple[Callable[[], Floats | None], ...] = (
        *(partial(np.asarray, loop) for loop in unrolled),
        lambda: project_to_plane(points, normals),
        lambda: turned(develop(points, normals), points) if whole else develop(points, normals),
        lambda: turned(map_to_circle(points), points) if whole else map_to_circle(points),
    )
    for plane_map in maps:
        loop = plane_map()
        loop = None if loop is None else parted(loop, outline.vertex)
        try:
            if loop is not None and signed_area(loop) > 0 and _perimeter(loop) < LARGEST_STRETCH * _perimeter(points):
                inside, faces = triangulate_polygon(loop, size * coarsening)
                _check_slits(outline, len(inside), faces)
                return loop, inside, faces
        except SurfaceError as error:
            reason = str(error)
    name = segment_name(network, outline.cycle.sides[0].segment)
    raise SurfaceError(f"the patch beside {name} cannot be triangulated: {reason}")
