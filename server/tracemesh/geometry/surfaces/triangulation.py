"""Quality constrained Delaunay triangulation of a planar polygon whose edges are never split (thesis section 4.4.2).

Interior points of a hexagonal lattice, relaxed by smoothing: larger smallest angles than Delaunay refinement, which the
thesis uses (Triangle, non-commercial) and which also splits the boundary.
"""

from typing import Any

import numpy as np
import pythoncdt
from scipy.spatial import cKDTree

from tracemesh.errors import SurfaceError
from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.surfaces.opening import half_disk, opened, smallest_angles

CLEARANCE = 0.62  # smallest distance of a lattice point to the boundary, in lattice spacings
GROWTH = 0.5  # of the spacing per distance from the boundary, where the inside is coarser
SHORT = 0.5  # an edge over the longer one beside it
MOST_POINTS = 3e6  # of one patch
RELAXATIONS = 2  # of two smoothing steps each
OPENINGS = 4  # rounds of moving points of small angles


def triangulate_polygon(loop: Floats, spacing: float) -> tuple[Floats, Ints]:
    """Triangles inside a simple polygon.

    loop: (k, 2) corners, counter-clockwise. spacing: wanted length of interior edges; where it is larger than the edges
    of
    the loop, triangles grow away from them.
    Returns interior points (m, 2) and faces (f, 3), counter-clockwise, indices into loop then interior points.
    No edge inside joins two corners of the loop, except across an acute corner. Raises SurfaceError if the polygon
    crosses itself or the spacing is too small for it.
    """
    expected = float(np.prod(np.ptp(loop, axis=0)) / spacing**2)
    if not expected < MOST_POINTS:
        raise SurfaceError(
            f"a mesh size of {spacing:.3g} m asks for some {expected:.1g} vertices in one patch: wanted a larger one"
        )
    fixed = np.vstack([loop, _points_beside_short_edges(loop)])
    inside = _graded_lattice(loop, fixed, spacing)
    faces = _constrained_delaunay(len(loop), np.vstack([fixed, inside]))
    inside = np.vstack([inside, loop[_first_chords(loop, faces)].mean(1)])
    faces = _constrained_delaunay(len(loop), np.vstack([fixed, inside]))
    for _ in range(RELAXATIONS if len(inside) else 0):
        inside = _smoothed(fixed, _smoothed(fixed, inside, faces), faces)
        faces = _constrained_delaunay(len(loop), np.vstack([fixed, inside]))
    points, faces = _opened(len(loop), np.vstack([fixed, inside]), faces)
    inside, faces = _without_strays(len(loop), points[len(loop) :], faces)
    return _split_chords(loop, inside, faces)


def _points_beside_short_edges(loop: Floats) -> Floats:
    """(m, 2) a point inside of every edge much shorter than one beside it: where it opens the smallest angle of its
    triangles with the edge and the two beside it most.
    """
    count = len(loop)
    length = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)
    longest = np.maximum(np.roll(length, 1), np.roll(length, -1))
    found = np.empty((0, 2))
    for k in np.flatnonzero(length < SHORT * longest):
        corners = loop[[(k + i) % count for i in (-1, 0, 1, 2)]]
        candidates = corners[1:3].mean(0) + longest[k] * half_disk(corners[2] - corners[1])
        angles = smallest_angles(corners[:3, None], corners[1:, None], candidates).min(0)
        others = np.delete(loop, [(k + i) % count for i in (-1, 0, 1, 2)], axis=0)
        far = cKDTree(np.vstack([others, found])).query(candidates)[0] > CLEARANCE * longest[k] / 2
        if (angles * far).max() > 0:
            found = np.vstack([found, candidates[np.argmax(angles * far)]])
    return found


def _graded_lattice(loop: Floats, fixed: Floats, spacing: float) -> Floats:
    """(m, 2) points inside a polygon: lattices of doubling spacing, each where the distance to the boundary
    allows it.
    """
    finest = min(spacing, float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).mean()))
    steps = max(1, round(float(np.log2(spacing / finest))) + 1)
    sizes = [spacing * 0.5**k for k in range(steps)]
    samples = cKDTree(_densified(loop, sizes[-1] / 4))
    points, farthest = fixed[len(loop) :], np.inf
    beside = len(points)
    for size in sizes:
        nearest = CLEARANCE * size + (size - sizes[-1]) / GROWTH
        level = _lattice(loop, size)
        distance = samples.query(level)[0]
        level = level[(distance > nearest) & (distance <= farthest)]
        if len(points) and len(level):
            level = level[cKDTree(points).query(level)[0] > size]  # also off the points beside short edges
        points, farthest = np.vstack([points, level]), nearest + size
    return points[beside:]


def _densified(loop: Floats, spacing: float) -> Floats:
    """Points along a polygon's edges, no farther from each other than the spacing."""
    edges = np.roll(loop, -1, axis=0) - loop
    parts = np.ceil(np.linalg.norm(edges, axis=1) / spacing - 1e-6).astype(np.int64)
    step = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.asarray(np.repeat(loop, parts, axis=0) + np.repeat(edges / parts[:, None], parts, axis=0) * step[:, None])


def _without_strays(count: int, inside: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Interior points without those in no face, which fell outside of a very crooked polygon. count: corners of
    the loop.
    """
    used = np.zeros(count + len(inside), bool)
    used[faces] = True
    used[:count] = True
    return inside[used[count:]], (np.cumsum(used) - 1)[faces]


def _constrained_delaunay(count: int, points: Floats) -> Ints:
    """(f, 3) faces of the constrained Delaunay triangulation of the polygon of the first points with the others
    inside.
    """
    corners = np.arange(count, dtype=np.uint32)
    # Arrays are buffers, which numpy's types say only from Python 3.12 on.
    vertices: Any = points
    edges: Any = np.column_stack([corners, np.roll(corners, -1)])
    mesh = pythoncdt.Triangulation(
        pythoncdt.VertexInsertionOrder.AUTO, pythoncdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0
    )
    try:
        mesh.insert_vertices(vertices)
        mesh.insert_edges(edges)
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


def _smoothed(fixed: Floats, inside: Floats, faces: Ints) -> Floats:
    """Free points moved to the area-weighted mean of the centroids of their triangles."""
    points = np.vstack([fixed, inside])
    a, b, c = points[faces].transpose(1, 0, 2)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    weight = np.bincount(faces.ravel(), np.repeat(area, 3), len(points))
    moment = (a + b + c) / 3 * area[:, None]
    mean = np.column_stack([np.bincount(faces.ravel(), np.repeat(moment[:, k], 3), len(points)) for k in range(2)])
    weight, mean = weight[len(fixed) :, None], mean[len(fixed) :]
    return np.where(weight > 0, mean / np.where(weight > 0, weight, 1.0), inside)


def _opened(count: int, points: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Points and faces without angles that moving an interior point opens. count: corners of the loop."""
    for _ in range(OPENINGS):
        moved = opened(points, faces, count)
        if np.array_equal(moved, points):
            break
        points, faces = moved, _constrained_delaunay(count, moved)
    return points, faces


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
    chord = on_loop & (gap != 1) & (gap != count - 1)
    if chord.any():
        chord &= ~_acute_ears(loop, edges, gap)
    chosen: list[tuple[int, int]] = []
    used: set[int] = set()
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
