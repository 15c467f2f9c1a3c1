"""Where placed curves cross: they come near each other, at an angle, with the same normal."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.nodes.contacts import NORMAL
from tracemesh.geometry.nodes.floating import FloatingCurve, Pose

REACH = 0.03
"""m, largest distance of two curves that may still cross."""
LARGEST_TILT = float(np.radians(8.0))
"""Between the normals of curves that may still cross."""
LEAST_ANGLE = float(np.radians(10.0))
"""Between the directions of curves that cross: nearly parallel ones pass by each other."""
_OFFSET = 0.008
"""m, standard deviation of the distance of two placed curves along their normals."""


@dataclass(frozen=True)
class Crossing:
    """Arc lengths on the two curves, m; distance there, m; angle between the normals there, rad."""

    s: float
    t: float
    distance: float
    tilt: float


def find_crossings(a: FloatingCurve, pose_a: Pose, b: FloatingCurve, pose_b: Pose) -> list[Crossing]:
    """Where two placed curves cross, nearest first; one place may be found more than once."""
    one, other = _Track.of(a, pose_a), _Track.of(b, pose_b)
    pairs = KDTree(one.points).sparse_distance_matrix(KDTree(other.points), REACH, output_type="coo_matrix")
    i, j, tilt = _plausible(one, other, pairs.row.astype(np.int64), pairs.col.astype(np.int64))
    ds, dt, distance = _closest_approach(one, other, i, j)
    here = (np.abs(ds) <= a.arc[1] * 0.51) & (np.abs(dt) <= b.arc[1] * 0.51)
    columns = zip(a.arc[i] + ds, b.arc[j] + dt, distance, tilt, strict=True)
    found = [Crossing(*map(float, row)) for row, fine in zip(columns, here, strict=True) if fine]
    return sorted(found, key=lambda c: c.distance)


def crossing_odds(crossing: Crossing) -> float:
    """How much likelier the distance and the angle are where curves cross than where they pass each other by chance."""
    crossing_distance = 2 * np.exp(-((crossing.distance / _OFFSET) ** 2) / 2) / (_OFFSET * np.sqrt(2 * np.pi))
    crossing_tilt = np.exp(-((crossing.tilt / NORMAL) ** 2) / 4) / (2 * NORMAL**2)
    return float(crossing_distance * REACH * crossing_tilt * LARGEST_TILT**2 / 2)


@dataclass(frozen=True)
class _Track:
    """A placed curve's table."""

    points: Floats
    tangents: Floats
    normals: Floats

    @staticmethod
    def of(curve: FloatingCurve, pose: Pose) -> "_Track":
        return _Track(pose.points(curve), curve.position(curve.arc, 1) @ pose.rotation.T, pose.normals(curve))


def _plausible(one: _Track, other: _Track, i: Ints, j: Ints) -> tuple[Ints, Ints, Floats]:
    """Pairs of rows whose normals are alike and whose directions are not, and the angle between the normals."""
    tilt = np.linalg.norm(one.normals[i] - other.normals[j], axis=1)
    along = np.abs(np.einsum("ij,ij->i", one.tangents[i], other.tangents[j]))
    fine = (tilt < LARGEST_TILT) & (along < np.cos(LEAST_ANGLE))
    return i[fine], j[fine], tilt[fine]


def _closest_approach(one: _Track, other: _Track, i: Ints, j: Ints) -> tuple[Floats, Floats, Floats]:
    """Ways along both tangent lines to where they are closest, and their distance there."""
    between, u, v = other.points[j] - one.points[i], one.tangents[i], other.tangents[j]
    cosine = np.einsum("ij,ij->i", u, v)
    along, across = np.einsum("ij,ij->i", between, u), np.einsum("ij,ij->i", between, v)
    ds = (along - across * cosine) / (1 - cosine**2)
    dt = (along * cosine - across) / (1 - cosine**2)
    return ds, dt, np.linalg.norm(between + dt[:, None] * v - ds[:, None] * u, axis=1)
