"""How times and errors are measured; shares no code with what is measured."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp, log
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags_array, eye_array, kron
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def warm_seconds(work: Callable[[], object], repeats: int = 7, limit: float = 10.0) -> float:
    """Least processor time of some calls, after one that does not count; none is begun after `limit` seconds."""
    start = perf_counter()
    work()
    times: list[float] = []
    while not times or (len(times) < repeats and perf_counter() - start < limit):
        begin = process_time()
        work()
        times.append(process_time() - begin)
    return min(times)


def yardstick() -> float:
    """Least processor time, s, of work that never changes: a sparse factorisation and a loop of Python."""
    line = diags_array([-1.0, 2.01, -1.0], offsets=[-1, 0, 1], shape=(120, 120))
    grid = (kron(line, eye_array(120)) + kron(eye_array(120), line)).tocsc()
    return warm_seconds(lambda: (splu(grid), sum(i * i for i in range(500_000))), 5)


def fitted_exponent(sizes: Sequence[float], values: Sequence[float]) -> float | None:
    """Exponent p of the least-squares fit values ~ sizes^p; None for fewer than two."""
    if len(sizes) < 2:
        return None
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def geometric_mean(values: Sequence[float]) -> float:
    return exp(sum(log(v) for v in values) / len(values))


@dataclass(frozen=True)
class Motion:
    """A rotation (3, 3) and then a translation (3,), m."""

    rotation: Floats
    translation: Floats

    def apply(self, points: Floats) -> Floats:
        """Moved points (n, 3)."""
        return np.asarray(points @ self.rotation.T + self.translation)


def paired_motion(points: Floats, targets: Floats) -> Motion:
    """The motion that brings points (n, 3) nearest to their partners (n, 3)."""
    centre, goal = points.mean(0), targets.mean(0)
    rotation = Rotation.align_vectors(targets - goal, points - centre)[0].as_matrix()
    return Motion(rotation, goal - rotation @ centre)


def closest_motion(points: Floats, closest: Callable[[Floats], Floats], iterations: int = 60) -> Motion:
    """The motion of a rigid iterative-closest-point registration without scale.

    closest: the nearest points of the truth. The points (n, 3) must start with nearly the right orientation.
    """
    motion = Motion(np.eye(3), closest(points).mean(0) - points.mean(0))
    moved = motion.apply(points)
    for _ in range(iterations):
        motion = paired_motion(points, closest(moved))
        before, moved = moved, motion.apply(points)
        if np.abs(moved - before).max() < 1e-9 * np.ptp(moved):
            break
    return motion


def vertex_areas(vertices: Floats, faces: Ints) -> Floats:
    """A third of the areas of the triangles around each vertex (n,)."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.asarray(np.bincount(faces.ravel(), np.repeat(area / 3, 3), len(vertices)), np.float64)


def mean_over_area(values: Floats, vertices: Floats, faces: Ints) -> float:
    """Mean of values (n,) at vertices, weighted with their share of the area."""
    return float(np.average(values, weights=vertex_areas(vertices, faces)))
