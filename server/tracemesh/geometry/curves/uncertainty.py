"""Standard uncertainty of every point, from the adjustment of its network.

Networks as probable as the solution are drawn from the factorised normal equations: nodes, rotations, scales, shifts.
What all points have in common, position and attitude of the whole, is taken out of every draw: the scan cannot know it,
and it changes no shape. To the variance over the draws comes that of the way between two nodes, a random walk tied at
both ends (a Brownian bridge), whose variance per metre is that of the frames' noise.
"""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.adjustment import Adjustment, Corrections
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.rotations import hat

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MOST, _FEWEST = 64, 16  # draws: a standard deviation is then known to 9 % and 18 %
_ROWS = 250  # at which draws are looked at; what they show is smooth between nodes
_NUMBERS = 3_000_000  # to hold at once
_SEED = 0
_FLAT = 1e-6  # of the largest singular value: curves in a line can be turned about it without being moved


def _share(layout: Layout, rows: Ints) -> Floats:
    """How far (k,) rows (k,) are on the way from their segment's start (0) to its end (1)."""
    segment = layout.row_segment[rows]
    result: Floats = (layout.arc[rows] - layout.arc[layout.segment_rows[segment, 0]]) / layout.segment_lengths[segment]
    return result


def _deviations(layout: Layout, rows: Ints, points: Floats, tangent: Floats, drawn: Corrections) -> Floats:
    """Deviations (k, 3, d), m, at rows (k,) of points (n, 3) with unit tangents (n, 3), for d drawn corrections."""
    segment, curve = layout.row_segment[rows], layout.curve[rows]
    first, last = layout.segment_rows[segment].T
    t = _share(layout, rows)[:, None]
    mark, (a, b) = layout.segments[segment], layout.segment_nodes[segment].T
    bulge = points[rows] - (1 - t) * points[first] - t * points[last]
    before, after = (1 - t) * (tangent[rows] - tangent[first]), t * (tangent[rows] - tangent[last])
    effect = np.concatenate([-hat(bulge), np.stack([bulge, before, after], axis=2)], axis=2)
    nodes, rotation, scale, shift = (np.moveaxis(part, 0, -1) for part in vars(drawn).values())
    single = np.stack([scale[curve], shift[mark], shift[mark + 1]], axis=1)
    ends = (1 - t)[:, :, None] * nodes[a] + t[:, :, None] * nodes[b]
    result: Floats = ends + effect @ np.concatenate([rotation[curve], single], axis=1)
    return result


def _without_motion(deviations: Floats, points: Floats) -> Floats:
    """Deviations (k, 3, d) less the translation and the small rotation of the whole that are nearest to each."""
    x = points - points.mean(axis=0)
    x /= np.sqrt(np.mean(x**2))
    motions = np.concatenate([np.broadcast_to(np.eye(3), (len(x), 3, 3)), hat(x)], axis=2).reshape(-1, 6)
    basis, size, _ = np.linalg.svd(motions, full_matrices=False)
    basis = basis[:, size > _FLAT * size[0]]
    flat = deviations.reshape(len(basis), -1)
    return np.asarray((flat - basis @ (basis.T @ flat)).reshape(deviations.shape))


def point_uncertainty(adjustment: Adjustment, layout: Layout, points: Floats, tangent: Floats, walk: Floats) -> Floats:
    """Standard uncertainty (n,), m, of points (n, 3) at a layout's rows: the root mean square distance from the truth.

    tangent: (n, 3). walk: (s, 3, 3) m, covariance per metre of positions along each segment.
    """
    rows = np.union1d(layout.marks, np.linspace(0, layout.size - 1, _ROWS).astype(np.int64))
    count = int(np.clip(_NUMBERS // (3 * len(rows)), _FEWEST, _MOST))
    drawn = adjustment.draws(count, np.random.default_rng(_SEED))
    moved = _without_motion(_deviations(layout, rows, points, tangent, drawn), points[rows])
    common = np.interp(np.arange(layout.size), rows, np.einsum("kid,kid->k", moved, moved) / count)
    t = _share(layout, np.arange(layout.size))
    total = np.trace(walk, axis1=1, axis2=2) * layout.segment_lengths
    bridge = total[layout.row_segment] * t * (1 - t)
    result: Floats = np.sqrt(common + bridge)
    return result
