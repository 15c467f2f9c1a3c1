"""A curve network with more points on its segments, for meshes finer than the network itself."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from tracemesh.geometry.network import CurveNetwork, Floats, Ints, Segment
from tracemesh.geometry.surfaces.curvature import normalised


def subdivided(network: CurveNetwork, spacing: float) -> CurveNetwork:
    """The network with every edge longer than the spacing (m) divided evenly; new points come after the given ones.

    Positions and normals of the new points lie on the cubic spline through their segment's.
    """
    points, normals, segments = [network.points], [network.normals], []
    count = len(network.points)
    for segment in network.segments:
        between, facing, parts = _points_between(network, segment, spacing)
        new = count + np.arange(len(between))
        segments.append(
            replace(segment, points=np.insert(segment.points, np.repeat(1 + np.arange(len(parts)), parts - 1), new))
        )
        points.append(between)
        normals.append(facing)
        count += len(between)
    return replace(network, points=np.vstack(points), normals=np.vstack(normals), segments=tuple(segments))


def _points_between(network: CurveNetwork, segment: Segment, spacing: float) -> tuple[Floats, Floats, Ints]:
    """Positions and normals of the new points of one segment, and the number of parts of every edge."""
    points, normals = network.points[segment.points], network.normals[segment.points]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    parts = np.maximum(np.ceil(lengths / spacing - 1e-6), 1).astype(np.int64)
    knots = np.concatenate([[0.0], np.cumsum(lengths)])
    values = np.column_stack([points, normals])
    closed = segment.points[0] == segment.points[-1]
    spline = CubicSpline(knots, values, bc_type="periodic") if closed else CubicSpline(knots, values)
    step = np.concatenate([np.arange(1, p) / p for p in parts])
    at = np.repeat(knots[:-1], parts - 1) + step * np.repeat(lengths, parts - 1)
    values = np.asarray(spline(at))
    return values[:, :3], normalised(values[:, 3:]), parts
