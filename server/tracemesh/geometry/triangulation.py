"""Quality constrained Delaunay triangulation of a planar polygon whose edges are never split (thesis section 4.4.2).

Interior points of a hexagonal lattice, relaxed by smoothing: larger smallest angles than Delaunay refinement, which the
thesis uses (Triangle, non-commercial) and which also splits the boundary.
"""

import numpy as np
import pythoncdt
from scipy.spatial import cKDTree

from tracemesh.errors import SurfaceError
from tracemesh.geometry.network import Floats, Ints

CLEARANCE = 0.62  # smallest distance of a lattice point to the boundary, in lattice spacings
GROWTH = 0.5  # of the spacing per distance from the boundary, where the inside is coarser
RELAXATIONS = 2  # of two smoothing steps each


def triangulate_polygon(loop: Floats, spacing: float) -> tuple[Floats, Ints]:
    """Triangles inside a simple polygon.

    loop: (k, 2) corners, counter-clockwise. spacing: wanted length of interior edges; where it is larger than the edges
    of
    the loop, triangles grow away from them.
    Returns interior points (m, 2) and faces (f, 3), counter-clockwise, indices into loop then interior points.
    No edge inside joins two corners of the loop, except across an acute corner. Raises SurfaceError if the polygon
    crosses itself.
    """
    inside = _graded_lattice(loop, spacing)
    faces = _constrained_delaunay(loop, inside)
    for _ in range(RELAXATIONS if len(inside) else 0):
        inside = _smoothed(loop, _smoothed(loop, inside, faces), faces)
        faces = _constrained_delaunay(loop, inside)
    return _split_chords(loop, inside, faces)


def _graded_lattice(loop: Floats, spacing: float) -> Floats:
    """(m, 2) points inside a polygon: lattices of doubling spacing, each where the distance to the boundary
    allows it.
    """
    finest = min(spacing, float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).mean()))
    steps = max(1, round(float(np.log2(spacing / finest))) + 1)
    sizes = [spacing * 0.5**k for k in range(steps)]
    samples = cKDTree(_densified(loop, sizes[-1] / 4))
    points, farthest = np.empty((0, 2)), np.inf
    for size in sizes:
        nearest = CLEARANCE * size + (size - sizes[-1]) / GROWTH
        level = _lattice(loop, size)
        distance = samples.query(level)[0]
        level = level[(distance > nearest) & (distance <= farthest)]
        if len(points) and len(level):
            level = level[cKDTree(points).query(level)[0] > size]
        points, farthest = np.vstack([points, level]), nearest + size
    return points


def _densified(loop: Floats, spacing: float) -> Floats:
    """Points along a polygon's edges, no farther from each other than the spacing."""
    edges = np.roll(loop, -1, axis=0) - loop
    parts = np.ceil(np.linalg.norm(edges, axis=1) / spacing).astype(np.int64)
    step = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.asarray(np.repeat(loop, parts, axis=0) + np.repeat(edges / parts[:, None], parts, axis=0) * step[:, None])


def _constrained_delaunay(loop: Floats, inside: Floats) -> Ints:
    """(f, 3) faces of the constrained Delaunay triangulation of a polygon and points inside it."""
    count = len(loop)
    corners = np.arange(count, dtype=np.uint32)
    mesh = pythoncdt.Triangulation(
        pythoncdt.VertexInsertionOrder.AUTO, pythoncdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0
    )
    try:
        mesh.insert_vertices(np.vstack([loop, inside]))
        mesh.insert_edges(np.column_stack([corners, np.roll(corners, -1)]))
    except RuntimeError as error:
        raise SurfaceError(f"the polygon crosses or touches itself: {error}") from None
    mesh.erase_outer_triangles()
    return mesh.triangles_array()["vertices"].astype(np.int64)


def _lattice(loop: Floats, spacing: float) -> Floats:
    """(m, 2) points of a hexagonal lattice inside a polygon."""
    rows, low = _row_numbers(loop, spacing)
    starts, ends, row = _spans(loop, low + rows * spacing * np.sqrt(0.75), rows)
    shift = loop[:, 0].min() + 0.5 * spacing * (row % 2)
    first, last = np.ceil((starts - shift) / spacing), np.floor((ends - shift) / spacing)
    count = np.maximum(last - first + 1, 0).astype(np.int64)
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    x = np.repeat(first * spacing + shift, count) + step * spacing
    return np.column_stack([x, np.repeat(low + row * spacing * np.sqrt(0.75), count)])


def _row_numbers(loop: Floats, spacing: float) -> tuple[Ints, float]:
    """Numbers of the lattice rows that meet the polygon, and the height of row 0."""
    low = float(loop[:, 1].min()) + 0.29 * spacing  # no row through a corner of an axis-aligned polygon
    return np.arange(int(np.ptp(loop[:, 1]) / (spacing * np.sqrt(0.75))) + 1), low


def _spans(loop: Floats, heights: Floats, rows: Ints) -> tuple[Floats, Floats, Ints]:
    """Intervals of every row that lie inside the polygon (even-odd rule): starts, ends and row numbers."""
    a, b = loop, np.roll(loop, -1, axis=0)
    edge, row = np.nonzero((a[:, None, 1] <= heights) != (b[:, None, 1] <= heights))
    along = (heights[row] - a[edge, 1]) / (b[edge, 1] - a[edge, 1])
    x = a[edge, 0] + along * (b[edge, 0] - a[edge, 0])
    order = np.lexsort((x, row))
    return x[order][0::2], x[order][1::2], rows[row[order][0::2]]


def _smoothed(loop: Floats, inside: Floats, faces: Ints) -> Floats:
    """Interior points moved to the area-weighted mean of the centroids of their triangles."""
    points = np.vstack([loop, inside])
    a, b, c = points[faces].transpose(1, 0, 2)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    weight = np.bincount(faces.ravel(), np.repeat(area, 3), len(points))
    moment = (a + b + c) / 3 * area[:, None]
    mean = np.column_stack([np.bincount(faces.ravel(), np.repeat(moment[:, k], 3), len(points)) for k in range(2)])
    return np.asarray(mean[len(loop) :] / weight[len(loop) :, None])


def _split_chords(loop: Floats, inside: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Split interior edges that join two corners of the loop in the middle, so that every patch has freedom across
    them.
    """
    count = len(loop)
    while True:
        chord = _first_chords(loop, faces)
        if not len(chord):
            return inside, faces
        middle = count + len(inside) + np.arange(len(chord))
        inside = np.vstack([inside, loop[chord].mean(1)])
        faces = _with_split_edges(faces, chord, middle)


def _first_chords(loop: Floats, faces: Ints) -> Ints:
    """(c, 2) chords to split, at most one per face so that all can be split at once."""
    count = len(loop)
    edges = faces[:, [[1, 2], [2, 0], [0, 1]]]
    gap = (edges[..., 1] - edges[..., 0]) % count
    on_loop = (edges < count).all(2)
    chord = on_loop & (gap != 1) & (gap != count - 1) & ~_acute_ears(loop, edges, gap)
    chosen, used = [], set()
    for face, k in np.argwhere(chord):
        a, b = sorted(map(int, edges[face, k]))
        beside = set(np.flatnonzero((faces == a).any(1) & (faces == b).any(1)).tolist())
        if used.isdisjoint(beside):
            used |= beside
            chosen.append((a, b))
    return np.array(chosen, np.int64).reshape(-1, 2)


def _acute_ears(loop: Floats, edges: Ints, gap: Ints) -> Ints:
    """Chords that cut off a corner of less than 60 degrees: splitting one would only halve the corner's angle."""
    count = len(loop)
    ahead, behind = np.roll(loop, -1, axis=0) - loop, np.roll(loop, 1, axis=0) - loop
    cosine = (ahead * behind).sum(1) / (np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1))
    acute = cosine > 0.5
    corner = np.where(gap == 2, edges[..., 0] + 1, edges[..., 1] + 1) % count
    return np.asarray(((gap == 2) | (gap == count - 2)) & acute[corner])


def _with_split_edges(faces: Ints, edges: Ints, middle: Ints) -> Ints:
    """Faces with some edges split at new vertices; no face has two of them."""
    for (a, b), m in zip(edges, middle, strict=True):
        beside = np.flatnonzero((faces == a).any(1) & (faces == b).any(1))
        halves = np.repeat(faces[beside], 2, axis=0)
        halves[0::2][halves[0::2] == a] = m
        halves[1::2][halves[1::2] == b] = m
        faces = np.vstack([np.delete(faces, beside, axis=0), halves])
    return faces
