"""Curves whose shape and orientation are known but not their place: what a scan without marked nodes amounts to."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from tracemesh.geometry.curves.cleaning import clean_curves
from tracemesh.geometry.curves.placement import place_curve, uniform_layout
from tracemesh.geometry.curves.quadrature import edge_vectors
from tracemesh.geometry.curves.resampling import resample
from tracemesh.geometry.curves.weights import choose_weights
from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.rotations import normalized
from tracemesh.geometry.scan import Scan

_STEP = 0.005
"""Spacing of frames, as a part of the longest curve: 1.6 % of the diagonal of a round object."""
_TABLE = 0.004
"""m, spacing of the tables in which nodes are looked for."""


@dataclass(frozen=True)
class FloatingCurve:
    """A curve up to a translation and, as far as its magnetometer was disturbed, a small turn about the vertical.

    arc: (k,) m, from 0 to its length. points: (k, 3) m, their mean at the origin. normals: (k, 3). start: m, what the
    odometer said at arc 0. position, normal: splines by arc length, m.
    """

    closed: bool
    boundary: bool
    arc: Floats
    points: Floats
    normals: Floats
    start: float
    position: CubicSpline
    normal: CubicSpline

    @property
    def length(self) -> float:
        """Arc length, m."""
        return float(self.arc[-1])

    def apart(self, one: Floats | float, other: Floats | float) -> Floats:
        """Signed way, m, from other to one arc length; around a closed curve the shorter one."""
        way = np.asarray(one) - other
        return (way + self.length / 2) % self.length - self.length / 2 if self.closed else way


@dataclass(frozen=True)
class Pose:
    """Where a floating curve is: turned about the vertical (rad) through its mean, then shifted (3,), m."""

    turn: float
    shift: Floats

    @property
    def rotation(self) -> Floats:
        """The turn (3, 3)."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def points(self, curve: FloatingCurve) -> Floats:
        """The curve's table of points (k, 3), m, in place."""
        result: Floats = curve.points @ self.rotation.T + self.shift
        return result

    def normals(self, curve: FloatingCurve) -> Floats:
        """The curve's table of normals (k, 3), in place."""
        result: Floats = curve.normals @ self.rotation.T
        return result


def float_curves(scan: Scan) -> tuple[FloatingCurve, ...]:
    """Every curve of a scan by itself, marks ignored; raises ScanError naming the first curve that cannot be used."""
    nothing: Ints = np.empty(0, np.int64)
    cleaned = clean_curves([replace(curve, node_samples=nothing, node_ids=nothing) for curve in scan.curves])
    curves = tuple(place_curve(curve) for curve in cleaned)
    step = _STEP * max(curve.length for curve in curves)
    layout = uniform_layout(curves, step)
    samples = resample(curves, layout, step)
    frames = choose_weights(curves, samples, step).frames
    steps = np.zeros((layout.size, 3))
    steps[layout.edges + 1] = edge_vectors(layout, frames)
    floating = []
    for i, curve in enumerate(curves):
        rows = slice(*layout.first[i : i + 2])
        path = layout.arc[rows], np.cumsum(steps[rows], axis=0), frames[rows, :, 1]
        floating.append(_floating(curve.closed, curve.boundary, float(cleaned[i].distance[0]), *path))
    return tuple(floating)


def _floating(
    closed: bool, boundary: bool, start: float, arc: Floats, points: Floats, normals: Floats
) -> FloatingCurve:
    if closed:  # what it lacks to close belongs to all of it alike
        points = points - np.outer(arc / arc[-1], points[-1] - points[0])
        points[-1], normals = points[0], np.concatenate([normals[:-1], normals[:1]])
    ends: Literal["periodic", "not-a-knot"] = "periodic" if closed else "not-a-knot"
    table = np.linspace(0.0, arc[-1], max(8, round(arc[-1] / _TABLE)) + 1)
    normal = CubicSpline(arc, normals, bc_type=ends)
    middle = CubicSpline(arc, points, bc_type=ends)(table).mean(axis=0)
    position = CubicSpline(arc, points - middle, bc_type=ends)
    return FloatingCurve(closed, boundary, table, position(table), normalized(normal(table)), start, position, normal)
