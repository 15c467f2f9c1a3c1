"""Triangulation of every patch of a network in a plane (thesis section 4.4.2)."""

from dataclasses import dataclass

import numpy as np

from tracemesh.errors import SurfaceError
from tracemesh.geometry.cell_complex import CellComplex, segment_name
from tracemesh.geometry.curvature import normalised
from tracemesh.geometry.cycles import Cycle
from tracemesh.geometry.network import CurveNetwork, Floats, Ints
from tracemesh.geometry.triangulation import triangulate_polygon


@dataclass(frozen=True)
class PatchMesh:
    """Triangulation of all patches, without positions of the interior vertices.

    faces: (f, 3); vertices below `fixed` are the network's points. patch: (f,) number of the face's cycle.
    flat: (f, 3, 2) m, corners of the faces, each patch in its own plane. count: number of vertices.
    """

    faces: Ints
    patch: Ints
    flat: Floats
    fixed: int
    count: int


def triangulate_patches(network: CurveNetwork, complex_: CellComplex, spacing: float | None) -> PatchMesh:
    """Triangulate every face of a cell complex. spacing: edge length inside, m; None takes each patch's own boundary
    spacing.
    """
    fixed = count = len(network.points)
    faces, flat, patch = [], [], []
    for number, cycle in enumerate(complex_.faces):
        points = network.points[cycle.points]
        size = spacing or float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).mean())
        loop, inside, triangles = _triangulate(network, cycle, size)
        index = np.concatenate([cycle.points, count + np.arange(len(inside))])
        count += len(inside)
        faces.append(index[triangles])
        flat.append(np.vstack([loop, inside])[triangles])
        patch.append(np.full(len(triangles), number))
    return PatchMesh(np.vstack(faces), np.concatenate(patch), np.concatenate(flat), fixed, count)


def _triangulate(network: CurveNetwork, cycle: Cycle, spacing: float) -> tuple[Floats, Floats, Ints]:
    """Loop in the plane, interior points and faces of one patch; the first map to the plane that is injective."""
    points, normals = network.points[cycle.points], network.normals[cycle.points]
    for loop in (project_to_plane(points, normals), map_to_circle(points)):
        try:
            if loop is not None:
                return loop, *triangulate_polygon(loop, spacing)
        except SurfaceError:
            continue
    raise SurfaceError(f"the patch beside {segment_name(network, cycle.sides[0].segment)} cannot be triangulated")


def project_to_plane(points: Floats, normals: Floats) -> Floats | None:
    """(k, 2) m, projection along the average normal; None if that vanishes or turns the loop over. points, normals: (k,
    3).
    """
    average = normals.mean(0)
    if np.linalg.norm(average) < 0.1:
        return None
    normal = normalised(average)
    first = normalised(np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal))
    loop = (points - points.mean(0)) @ np.column_stack([first, np.cross(normal, first)])
    return loop if signed_area(loop) > 0 else None


def map_to_circle(points: Floats) -> Floats:
    """(k, 2) m, the loop laid on a circle of its own length. points: (k, 3)."""
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    angle = 2 * np.pi * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()
    return np.asarray(np.column_stack([np.cos(angle), np.sin(angle)]) * steps.sum() / (2 * np.pi))


def signed_area(loop: Floats) -> float:
    """m^2, positive for a counter-clockwise loop (k, 2)."""
    x, y = loop.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
