"""Surfaces of a network that changes curve by curve: only patches near the change are solved again.

A patch is known by the positions and normals of its boundary. Patches with a new boundary are meshed; they and those
that share
a point with them are solved, held by the next ring of patches. Farther patches stay: a change fades within a patch or
two.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tracemesh.geometry.network import CurveNetwork, Floats, Ints
from tracemesh.geometry.surfaces.bridges import Outline
from tracemesh.geometry.surfaces.cell_complex import CellComplex
from tracemesh.geometry.surfaces.linear_surface import settled_surface
from tracemesh.geometry.surfaces.patches import PatchMesh, outlines_of
from tracemesh.geometry.surfaces.refinement import refine
from tracemesh.geometry.surfaces.surface_stages import (
    Progress,
    Stages,
    SurfaceParameters,
    SurfaceResult,
    finished,
    linear_patches,
    prepared,
)
from tracemesh.geometry.surfaces.two_scales import LARGEST_REFINED
from tracemesh.geometry.surfaces.whole_surface import whole_surface

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class _Solved:
    """A patch as solved. planar: (k + m, 2) its boundary, from a canonical start on, and its inside in the plane.

    faces: (f, 3) into planar. inside, normals: (m, 3).
    """

    planar: Floats
    faces: Ints
    inside: Floats
    normals: Floats


class SurfaceSolver:
    """Spans surfaces over one network after another and reuses the patches they have in common."""

    def __init__(self, parameters: SurfaceParameters | None = None) -> None:
        """parameters: as for `span_surface`.

        With soft constraints every point moves, and a mesh too large to be refined itself follows a coarse one as a
        whole: then nothing is reused.
        """
        self._parameters = parameters or SurfaceParameters()
        self._known: dict[bytes, _Solved] = {}
        self._refined = self._whole = False

    def span(self, network: CurveNetwork, progress: Progress | None = None) -> SurfaceResult:
        """The surface over a network; errors as for `span_surface`. `resolved_patches` in the report counts
        those solved.
        """
        stages = Stages(progress)
        complex_ = prepared(network, self._parameters, stages)
        outlines = outlines_of(complex_)
        keys = [_key(outline) for outline in outlines]
        changed = np.array([key not in self._known for key in keys])
        if changed.all() or self._whole or complex_.groups or self._parameters.soft is not None:
            changed[:] = True
            patches, vertices, normals, refinement = whole_surface(complex_, self._parameters, stages)
            self._refined = bool(refinement["used"])
            self._whole = self._refined and patches.count > LARGEST_REFINED
        else:
            refinement = {"mode": self._parameters.refinement, "used": self._refined}
            patches, vertices, normals = self._assembled(complex_, outlines, keys, changed, stages)
            stages.begin("nearby patches", 0.6)
            vertices, normals, changed = _solved_nearby(patches, vertices, normals, changed, self._refined)
        self._known = dict(zip(keys, _taken_apart(outlines, patches, vertices, normals), strict=True))
        result = finished(complex_, patches, vertices, normals, refinement, stages)
        return replace(result, report=result.report | {"resolved_patches": int(changed.sum())})

    def _assembled(
        self, complex_: CellComplex, outlines: list[Outline], keys: list[bytes], changed: Mask, stages: Stages
    ) -> tuple[PatchMesh, Floats, Floats]:
        """All patches: the known ones as they were, the changed ones meshed and solved by themselves."""
        known = dict(self._known)
        if changed.any():
            part = _part_of(complex_, outlines, changed)
            parts = _taken_apart(outlines_of(part), *linear_patches(part, self._parameters, stages))
            known |= zip([key for key, new in zip(keys, changed, strict=True) if new], parts, strict=True)
        return _joined(complex_.network, outlines, [known[key] for key in keys])


def _start(outline: Outline) -> int:
    """Where the walk around a patch begins, wherever its curves do: at the point with the smallest coordinates."""
    return int(np.lexsort(outline.points.T[::-1])[0])


def _key(outline: Outline) -> bytes:
    """Equal for equal boundaries."""
    return np.roll(np.hstack([outline.points, outline.normals]), -_start(outline), axis=0).tobytes()


def _taken_apart(outlines: list[Outline], patches: PatchMesh, vertices: Floats, normals: Floats) -> list[_Solved]:
    """Every patch by itself."""
    solved = []
    ends = np.append(patches.starts[1:], len(patches.vertex))
    for number, (outline, begin, end) in enumerate(zip(outlines, patches.starts, ends, strict=True)):
        size, shift = len(outline.points), _start(outline)
        faces = patches.planar_faces[patches.patch == number] - begin
        faces = np.where(faces < size, (faces - shift) % size, faces)
        planar = patches.planar[begin:end]
        inside = patches.vertex[begin + size : end]
        rolled = np.vstack([np.roll(planar[:size], -shift, axis=0), planar[size:]])
        solved.append(_Solved(rolled, faces, vertices[inside], normals[inside]))
    return solved


def _joined(network: CurveNetwork, outlines: list[Outline], solved: list[_Solved]) -> tuple[PatchMesh, Floats, Floats]:
    """All patches as one mesh with its vertices and normals."""
    count = fixed = len(network.points)
    faces, vertex, patch, starts, begin = [], [], [], [], 0
    for number, (outline, one) in enumerate(zip(outlines, solved, strict=True)):
        inside = count + np.arange(len(one.inside))
        vertex += [np.roll(outline.vertex, -_start(outline)), inside]
        faces.append(one.faces + begin)
        patch.append(np.full(len(one.faces), number))
        starts.append(begin)
        begin += len(one.planar)
        count += len(inside)
    planar = np.vstack([one.planar for one in solved])
    mesh = PatchMesh(
        planar, np.vstack(faces), np.concatenate(vertex), np.concatenate(patch), np.array(starts),
        np.zeros((count, 3)), fixed, count,
    )  # fmt: skip
    vertices = np.vstack([network.points, *(one.inside for one in solved)])
    return mesh, vertices, np.vstack([network.normals, *(one.normals for one in solved)])


def _part_of(complex_: CellComplex, outlines: list[Outline], chosen: Mask) -> CellComplex:
    """Some of the faces by themselves, over the points that they use."""
    network = complex_.network
    used = np.unique(np.concatenate([o.vertex for o, c in zip(outlines, chosen, strict=True) if c]))
    number = np.full(len(network.points), -1)
    number[used] = np.arange(len(used))
    faces = tuple(
        replace(face, points=number[face.points]) for face, c in zip(complex_.faces, chosen, strict=True) if c
    )
    segments = tuple(replace(segment, points=number[segment.points]) for segment in network.segments)
    part = replace(
        network,
        points=network.points[used],
        normals=network.normals[used],
        nodes=number[network.nodes],
        segments=segments,
        uncertainty=None,
    )
    return replace(complex_, network=part, faces=faces)


def _solved_nearby(
    patches: PatchMesh, vertices: Floats, normals: Floats, changed: Mask, refined: bool
) -> tuple[Floats, Floats, Mask]:
    """Vertices and normals with the changed patches and those around them solved together, and which patches
    those are.
    """
    if not changed.any():
        return vertices, normals, changed
    faces = patches.faces
    on_network = faces < patches.fixed
    uses = sparse.csr_matrix(
        (np.ones(on_network.sum()), (np.repeat(patches.patch, 3)[on_network.ravel()], faces[on_network])),
        (len(changed), patches.fixed),
    )
    active = (uses @ (uses.T @ changed)) > 0
    held = (uses @ (uses.T @ active)) > 0
    near, moving = held[patches.patch], faces[active[patches.patch]]
    free = np.setdiff1d(moving, np.arange(patches.fixed))
    order = np.concatenate([np.setdiff1d(faces[near], free), free])
    place = np.full(patches.count, -1)
    place[order] = np.arange(len(order))
    numbers = np.unique(patches.patch[near], return_inverse=True)[1]
    solve = _refined_again if refined else _rebuilt_again
    moved, turned = solve(vertices[order], normals[order], place[faces[near]], numbers, len(order) - len(free))
    vertices, normals = vertices.copy(), normals.copy()
    vertices[order], normals[order] = moved, turned
    return vertices, normals, active


def _refined_again(vertices: Floats, normals: Floats, faces: Ints, patch: Ints, fixed: int) -> tuple[Floats, Floats]:
    refined = refine(vertices, normals, faces, patch, fixed)
    return refined.vertices, refined.normals


def _rebuilt_again(vertices: Floats, normals: Floats, faces: Ints, patch: Ints, fixed: int) -> tuple[Floats, Floats]:
    return settled_surface(vertices, faces, normals[:fixed], np.zeros_like(vertices))
