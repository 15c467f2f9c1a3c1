"""Networks with exact positions and normals, for the tests of surfaces."""

from collections.abc import Callable, Sequence

import numpy as np

from tracemesh.geometry.network import CurveNetwork, Floats, Segment


def radial(points: Floats) -> Floats:
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def sideways(points: Floats) -> Floats:
    return radial(points * [1, 1, 0])


def upwards(points: Floats) -> Floats:
    return np.tile([0.0, 0.0, 1.0], (len(points), 1))


def rings(specs: Sequence[tuple[float, float, bool]], normal: Callable[[Floats], Floats]) -> CurveNetwork:
    """Closed curves without nodes: circles around z of (radius, height, boundary)."""
    points, segments, begin = [], [], 0
    for curve, (radius, height, boundary) in enumerate(specs):
        count = max(12, round(50 * radius))
        turn = 2 * np.pi * np.arange(count) / count
        points.append(np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(count, height)]))
        segments.append(Segment(np.append(np.arange(count), 0) + begin, boundary, curve))
        begin += count
    stacked = np.vstack(points)
    return CurveNetwork(stacked, normal(stacked), np.empty(0, np.int64), tuple(segments))


def octants(spacing: float, radius: float = 1.0) -> CurveNetwork:
    """Three great circles of a sphere."""
    nodes = radius * np.vstack([np.eye(3), -np.eye(3)])
    parts = round(np.pi / 2 * radius / spacing)
    turn = np.linspace(0, np.pi / 2, parts + 1)[1:-1, None]
    points, segments = [nodes], []
    for curve, (x, y) in enumerate(((0, 1), (1, 2), (2, 0))):
        corners = (x, y, x + 3, y + 3)
        for k in range(4):
            a, b = corners[k], corners[(k + 1) % 4]
            inner = 6 + (parts - 1) * len(segments) + np.arange(parts - 1)
            points.append(np.cos(turn) * nodes[a] + np.sin(turn) * nodes[b])
            segments.append(Segment(np.concatenate([[a], inner, [b]]), False, curve))
    stacked = np.vstack(points)
    return CurveNetwork(stacked, radial(stacked), np.arange(6), tuple(segments))


def window(parts: int, height: Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]) -> CurveNetwork:
    """A square [-1, 1]^2 and its two middle lines on the graph of a function that returns z, dz/dx and dz/dy."""
    grid = [(x, y) for y in (-1, 0, 1) for x in (-1, 0, 1)]
    lines = [(0, 1), (1, 2), (2, 5), (5, 8), (8, 7), (7, 6), (6, 3), (3, 0), (1, 4), (4, 7), (3, 4), (4, 5)]
    flat, segments = [np.array(grid, float)], []
    for number, (a, b) in enumerate(lines):
        t = (np.arange(1, parts) / parts)[:, None]
        flat.append((1 - t) * flat[0][a] + t * flat[0][b])
        inner = 9 + (parts - 1) * number + np.arange(parts - 1)
        segments.append(Segment(np.concatenate([[a], inner, [b]]), number < 8, 0 if number < 8 else number // 2 - 3))
    x, y = np.vstack(flat).T
    z, dx, dy = height(x, y)
    return CurveNetwork(
        np.column_stack([x, y, z]), radial(np.column_stack([-dx, -dy, np.ones_like(x)])), np.arange(9), tuple(segments)
    )
