"""Points of a plane triangulation placed where the smallest angle of the triangles around them is largest."""

import numpy as np

from tracemesh.geometry.network import Floats, Ints

SMALL = np.radians(20)  # angles that are opened
_SEARCHES = 3  # of one place, each about the best of the last


def opened(points: Floats, faces: Ints, fixed: int) -> Floats:
    """Points (n, 2) after moving the corners of triangles (f, 3) with small angles, one after another.

    fixed: number of first points that stay. Triangles remain valid; a Delaunay triangulation of the new points has
    angles at least as large.
    """
    points = points.copy()
    a, b, c = points[faces].transpose(1, 0, 2)
    small = smallest_angles(a, b, c) < SMALL
    for vertex in np.setdiff1d(faces[small], np.arange(fixed)):
        star = faces[(faces == vertex).any(1)]
        at = (star == vertex).argmax(1)
        rows = np.arange(len(star))
        points[vertex] = _best_place(points[star[rows, at - 2]], points[star[rows, at - 1]], points[vertex])
    return points


def _best_place(starts: Floats, ends: Floats, place: Floats) -> Floats:
    """(2,) where a point inside of edges (e, 2) opens the smallest angle to them most."""
    around = half_disk(np.array([1.0, 0.0]))
    reach = float(np.linalg.norm(starts - place, axis=1).max()) / 2
    for _ in range(_SEARCHES):
        candidates = place + reach * np.vstack([np.zeros((1, 2)), around, -around])
        angles = smallest_angles(starts[:, None], ends[:, None], candidates).min(0)
        place, reach = candidates[angles.argmax()], reach / 4
    return place


def half_disk(direction: Floats) -> Floats:
    """(m, 2) points of half a disk of radius 1 left of a direction (2,)."""
    radius, turn = (a.ravel() for a in np.meshgrid(np.linspace(0.1, 0.6, 11), np.linspace(0, np.pi, 19)[1:-1]))
    unit = complex(*direction) / abs(complex(*direction))
    points = radius * np.exp(1j * turn) * unit
    return np.column_stack([points.real, points.imag])


def smallest_angles(a: Floats, b: Floats, c: Floats) -> Floats:
    """(...) rad, smallest angle of triangles with corners (..., 2); negative if they turn clockwise."""
    a, b, c = (p[..., 0] + 1j * p[..., 1] for p in (a, b, c))
    angles = np.angle([(c - a) / (b - a), (a - b) / (c - b), (b - c) / (a - c)])
    return np.asarray(angles.min(0))
