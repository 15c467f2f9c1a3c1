"""First maps of a patch's boundary to the plane, before there is a surface to unroll (thesis section 4.4.2)."""

import numpy as np

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.cycles import turning_angles

SLIT_WIDTH = 1e-3  # by which the sides of a slit are drawn apart, in mean edges
SMALLEST_AVERAGE = 0.1  # length of the mean of unit normals below which its direction says nothing


def project_to_plane(points: Floats, normals: Floats) -> Floats | None:
    """(k, 2) m, projection along the average normal; None if that vanishes. points, normals: (k, 3)."""
    average = normals.mean(0)
    if np.linalg.norm(average) < SMALLEST_AVERAGE:
        return None
    normal = normalised(average)
    offset = points - points.mean(0)
    offset -= np.outer(offset @ normal, normal)
    first = normalised(offset[_farthest(offset)])
    return np.asarray(offset @ np.column_stack([first, np.cross(normal, first)]))


def _farthest(offset: Floats) -> int:
    """Corner with the largest offset (k, d): turns with the loop, and does not flicker between some equally far."""
    distance = np.linalg.norm(offset, axis=1)
    return int(np.argmax(distance > (1 - 1e-6) * distance.max()))


def turned(loop: Floats, points: Floats) -> Floats:
    """(k, 2) m, a loop in the plane turned as its shape in space, points (k, 3), has it, wherever it starts."""
    offset = loop - loop.mean(0)
    x, y = normalised(offset[_farthest(points - points.mean(0))])
    return np.asarray(offset @ np.array([[x, -y], [y, x]]))


def develop(points: Floats, normals: Floats) -> Floats:
    """(k, 2) m, the loop with its lengths and its geodesic turning, both changed as little as closes it. points,
    normals: (k, 3).

    Exact on developable surfaces, a cylinder that was cut open among them, where projection folds.
    """
    turning = turning_angles(points, normals)
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    turning = turning + (2 * np.pi - turning.sum()) / len(points)
    heading = np.cumsum(turning)
    edges = steps[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    edges -= edges.sum(0) * (steps / steps.sum())[:, None]
    return np.asarray(np.vstack([[0.0, 0.0], np.cumsum(edges, axis=0)[:-1]]))


def map_to_circle(points: Floats) -> Floats:
    """(k, 2) m, the loop laid on a circle of its own length: injective whatever the loop. points: (k, 3)."""
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    angle = 2 * np.pi * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()
    return np.asarray(np.column_stack([np.cos(angle), np.sin(angle)]) * steps.sum() / (2 * np.pi))


def parted(loop: Floats, vertex: Ints) -> Floats:
    """(k, 2) m, the loop with the two sides of every slit drawn apart, so that it does not touch itself.

    vertex: (k,) numbers of the corners; those that occur more than once lie on slits and move to their own side, left
    of the walk.
    """
    _, place, count = np.unique(vertex, return_inverse=True, return_counts=True)
    ahead, behind = np.roll(loop, -1, axis=0) - loop, loop - np.roll(loop, 1, axis=0)
    ahead, behind = (e / np.maximum(np.linalg.norm(e, axis=1, keepdims=True), 1e-300) for e in (ahead, behind))
    left = (ahead + behind) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    step = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).mean()
    return np.asarray(loop + SLIT_WIDTH * step * left * (count[place] > 1)[:, None])


def signed_area(loop: Floats) -> float:
    """m^2, positive for a counter-clockwise loop (k, 2)."""
    x, y = loop.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
