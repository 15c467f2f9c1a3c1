"""How far points, and the normals at them, are from a true mesh (thesis 3.7.3 and 5.3.2)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tracemesh.errors import InputError
from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.comparison.registration import Placement, register
from tracemesh.geometry.network import Floats, Ints

Alignment = Literal["none", "rigid", "similarity"]


@dataclass(frozen=True)
class Evaluation:
    """mean, rms, max, min: distance to the true surface in % of the truth's bounding-box diagonal (m).

    normal_deg: mean angle to the true normals, degrees; None when no normals were given. placement: how the points
    were aligned first. distance: (n,) m, of every point; signed: (n,) m, the same, negative inside the true surface.
    hausdorff: %, the largest distance of either surface's vertices to the other; None where nobody looked both ways.
    """

    mean: float
    rms: float
    max: float
    min: float
    normal_deg: float | None
    diagonal: float
    placement: Placement
    distance: Floats
    signed: Floats
    hausdorff: float | None = None

    def summary(self) -> dict[str, object]:
        """The figures as plain JSON."""
        figures: dict[str, object] = {
            "mean": self.mean,
            "rms": self.rms,
            "max": self.max,
            "min": self.min,
            "unit": "percent of the truth's diagonal",
            "normal_deg": self.normal_deg,
        }
        return figures if self.hausdorff is None else {**figures, "hausdorff": self.hausdorff}

    def text(self) -> str:
        """The figures for people."""
        lines = [f"{name:5}{getattr(self, name):10.4f} %" for name in ("mean", "rms", "max", "min")]
        if self.hausdorff is not None:
            lines.append(f"both ways, at most {self.hausdorff:.4f} % (Hausdorff distance)")
        lines.append(f"of the truth's diagonal, {self.diagonal:.4g} m")
        if self.normal_deg is not None:
            lines.append(f"normals off by {self.normal_deg:.3g} degrees on average")
        return "\n".join(lines)


def evaluate(
    points: Floats,
    normals: Floats | None,
    truth_vertices: Floats,
    truth_faces: Ints,
    align: Alignment = "none",
    progress: Callable[[float], None] = lambda fraction: None,
) -> Evaluation:
    """Distances of points (n, 3) m to the true mesh, after aligning them to it, and angles of normals (n, 3) if given.

    The true normals are those of the mesh's vertices, interpolated. `progress` hears the fraction of the alignment.
    Raises InputError when there are no points.
    """
    if len(points) == 0:
        raise InputError("wanted at least one point to evaluate, got none")
    placement = Placement(np.eye(3), np.zeros(3))
    if align != "none":
        placement = register(points, truth_vertices, truth_faces, align == "similarity", progress)
    placed, closest = placement.apply(points), ClosestPoints(truth_vertices, truth_faces)
    weights, distance, face = closest(placed)
    true = np.einsum("nk,nki->ni", weights, vertex_normals(truth_vertices, truth_faces)[truth_faces[face]])
    outside = np.einsum("ni,ni->n", placed - closest.at(weights, face), true) >= 0
    diagonal = float(np.linalg.norm(np.ptp(truth_vertices, axis=0)))
    percent = 100 * distance / diagonal
    angle = None
    if normals is not None:
        angle = float(np.degrees(np.mean(_angles(normals @ placement.rotation.T, true))))
    rms = float(np.sqrt(np.mean(percent**2)))
    worst, best = float(percent.max()), float(percent.min())
    signed = np.where(outside, distance, -distance)
    return Evaluation(float(percent.mean()), rms, worst, best, angle, diagonal, placement, distance, signed)


def hausdorff_distance(vertices: Floats, faces: Ints, other_vertices: Floats, other_faces: Ints) -> float:
    """Hausdorff distance of two meshes, m: the largest distance of a vertex of either to the other's surface.

    Exact up to what the surfaces do between their vertices.
    """
    there = ClosestPoints(other_vertices, other_faces)(vertices[np.unique(faces)])[1]
    back = ClosestPoints(vertices, faces)(other_vertices[np.unique(other_faces)])[1]
    return float(max(there.max(), back.max()))


def vertex_normals(vertices: Floats, faces: Ints) -> Floats:
    """Unit normals (n, 3) of a mesh's vertices: the mean of their faces' normals, weighted by area."""
    corners = vertices[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], doubled)
    result: Floats = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return result


def _angles(a: Floats, b: Floats) -> Floats:
    result: Floats = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    return result
