"""The curve network of one reading of a fixed array (the static devices of thesis 1.4): few sensors, all exact places.

Between two sensors a frame is the shortest rotation from one to the next (slerp), bent by what a cubic spline through
the developed frames (as in spline.py) has more than the straight line: exp(d) slerp. It passes through every sensor, is
smooth at them, exact where the rate of rotation is constant (lines, circles, helices), and linear in the rotations
from sensor to sensor, so that all that depends on the array alone is computed once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.sparse import block_diag, csr_array

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.assembly import assemble_network
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.positions import solve_positions
from tracemesh.geometry.curves.quadrature import edge_vectors
from tracemesh.geometry.curves.regression import RegressionSolver
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.rotations import exp, log
from tracemesh.geometry.sensor_array import SensorArray, SensorCurve

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
T = TypeVar("T", np.int64, np.float64)

_HALF = 0.5
_FEWEST = 2  # edges between two sensors
_MOST_POINTS = 1_000_000
_ROUNDING = 1e-9  # edges: what a step may be too short by


@dataclass(frozen=True)
class ArrayNetwork:
    """network: its nodes are the array's, its points centred on the mean of the sensors. sensors: (s, 3) m, where they
    are. gaps: (g, 3) m, what each segment lacked to lead from node to node; segment_lengths: (g,) m.
    """

    network: CurveNetwork
    sensors: Floats
    gaps: Floats
    segment_lengths: Floats


@dataclass(frozen=True)
class _Places:
    """Where frames are wanted. knot: (r,) sensor on a curve before each; gap: (r,) the gap that begins there; fraction:
    (r,) of the way to the next knot; bend: (r, g) map from the rotations of all gaps to what bends the frame.
    """

    knot: Ints
    gap: Ints
    fraction: Floats
    bend: csr_array


class ArraySolver:
    """Turns readings of one array into networks; all that does not depend on a reading is computed once."""

    def __init__(self, array: SensorArray, step: float) -> None:
        """step: m, at most, between points of the network; sensors are always points, and so is something between them.

        Raises ScanError for a step that leads to too many points.
        """
        self._array = array
        curves = tuple(_from_node(curve, array.nodes) for curve in array.curves)
        pieces = _pieces(curves, step)
        self._knots = np.concatenate([_knots(c, c.sensors) for c in curves])
        self._mounting = np.concatenate([_knots(c, c.mounting) for c in curves])
        self._gaps = np.flatnonzero(np.concatenate([np.append(np.ones(len(c.spacing), bool), False) for c in curves]))
        self._rows = _places(curves, [_row_places(p) for p in pieces])
        self._middles = _places(curves, [_middle_places(p) for p in pieces])
        self.layout = _layout(array, curves, pieces)
        self._sensor_rows = _sensor_rows(array, curves, pieces)
        self._regression = RegressionSolver(self.layout)

    def solve(self, rotations: Floats, weights: Weights | None = None) -> ArrayNetwork:
        """Network of sensor -> world rotations (s, 3, 3); weights: smooth by regression on SO(3) instead of passing
        through every sensor's frame. Raises ScanError for a wrong number of sensors.
        """
        if rotations.shape != (self._array.sensor_count, 3, 3):
            raise ScanError(f"wanted {self._array.sensor_count} sensors, got rotations of shape {rotations.shape}")
        frames = rotations[self._knots] @ self._mounting
        rates = log(frames[self._gaps + 1] @ np.swapaxes(frames[self._gaps], 1, 2))
        rows = _between(frames, rates, self._rows)
        if weights is None:
            edges = self._edges(rows, _between(frames, rates, self._middles))
        else:
            rows = self._regression.solve(rows, weights, rows).frames
            edges = edge_vectors(self.layout, rows)
        return self._placed(rows, edges)

    def _edges(self, rows: Floats, middles: Floats) -> Floats:
        """Integral of the tangent over every edge (e, 3), m, by Simpson's rule."""
        start, tangent = self.layout.edges, rows[:, :, 0]
        total = tangent[start] + 4 * middles[:, :, 0] + tangent[start + 1]
        result: Floats = self.layout.lengths[:, None] / 6 * total
        return result

    def _placed(self, frames: Floats, edges: Floats) -> ArrayNetwork:
        positions = solve_positions(self.layout, edges)
        points = positions.points - positions.points[self._sensor_rows].mean(axis=0)
        network = assemble_network(self.layout, points, frames, None, np.arange(len(self._array.curves)))
        return ArrayNetwork(network, points[self._sensor_rows], positions.gaps, self.layout.segment_lengths)


def _from_node(curve: SensorCurve, nodes: Ints) -> SensorCurve:
    """A closed curve begins at a node, if it has one."""
    shared = np.flatnonzero(np.isin(curve.sensors, nodes))
    return curve.starting_at(int(shared[0])) if curve.closed and len(shared) else curve


def _pieces(curves: Sequence[SensorCurve], step: float) -> list[Ints]:
    """Edges (g,) into which every gap of each curve is cut."""
    counts = [np.maximum(_FEWEST, np.ceil(c.spacing / step - _ROUNDING)) for c in curves]
    if sum(float(count.sum()) for count in counts) > _MOST_POINTS:
        raise ScanError(f"a step of {step:.3g} m would cut the array's curves into more than {_MOST_POINTS} pieces")
    return [count.astype(np.int64) for count in counts]


def _knots(curve: SensorCurve, values: NDArray[T]) -> NDArray[T]:
    """Values (m, ...) of the sensors along a curve; a closed one repeats its first."""
    return np.concatenate([values, values[:1]]) if curve.closed else values


def _row_places(pieces: Ints) -> Floats:
    """Places of rows in gaps: 1.5 is in the middle of the second gap."""
    starts = np.concatenate([i + np.arange(count) / count for i, count in enumerate(pieces)])
    return np.append(starts, float(len(pieces)))


def _middle_places(pieces: Ints) -> Floats:
    """Places of the middles of edges in gaps."""
    return np.concatenate([i + (np.arange(count) + _HALF) / count for i, count in enumerate(pieces)])


def _places(curves: Sequence[SensorCurve], places: Sequence[Floats]) -> _Places:
    knot, gap, fraction, bend = [], [], [], []
    first_knot = first_gap = 0
    for curve, place in zip(curves, places, strict=True):
        before = np.minimum(place.astype(np.int64), len(curve.spacing) - 1)
        knot.append(first_knot + before)
        gap.append(first_gap + before)
        fraction.append(place - before)
        bend.append(_bending(curve, before, place - before))
        first_knot, first_gap = first_knot + len(curve.spacing) + 1, first_gap + len(curve.spacing)
    return _Places(np.concatenate(knot), np.concatenate(gap), np.concatenate(fraction), csr_array(block_diag(bend)))


def _bending(curve: SensorCurve, gap: Ints, fraction: Floats) -> Floats:
    """Map (r, g) from the rotations of a curve's gaps to a spline through their sums, less the straight lines.

    The sums of a closed curve grow by a turn; the spline is periodic in what they have more than steady growth.
    """
    gaps = len(curve.spacing)
    arc = np.concatenate([[0.0], np.cumsum(curve.spacing)])
    sums = np.tril(np.ones((gaps + 1, gaps)), -1)
    if curve.closed:
        sums = sums - np.outer(arc / arc[-1], np.ones(gaps))
        sums[-1] = sums[0]  # zero, but for rounding
    if gaps == 1:
        return np.zeros((len(gap), 1))
    spline = CubicSpline(arc, sums, bc_type="periodic" if curve.closed else "not-a-knot")
    share = fraction[:, None]
    straight = (1 - share) * sums[gap] + share * sums[gap + 1]
    result: Floats = spline(arc[gap] + fraction * curve.spacing[gap]) - straight
    return result


def _between(frames: Floats, rates: Floats, places: _Places) -> Floats:
    """Frames (r, 3, 3) at places, from those at knots (k, 3, 3) and the rotations (g, 3), rad, of gaps."""
    turned = exp(places.fraction[:, None] * rates[places.gap]) @ frames[places.knot]
    result: Floats = exp(places.bend @ rates) @ turned
    return result


def _layout(array: SensorArray, curves: Sequence[SensorCurve], pieces: Sequence[Ints]) -> Layout:
    arcs, marks, nodes, first = [], [], [], [0]
    is_node = [True] * len(array.nodes)
    for curve, count in zip(curves, pieces, strict=True):
        knot = np.concatenate([[0], np.cumsum(count)])
        arcs.append(np.interp(np.arange(knot[-1] + 1), knot, np.concatenate([[0.0], np.cumsum(curve.spacing)])))
        sensors = _knots(curve, curve.sensors)
        at_node = np.isin(sensors, array.nodes)
        numbers = np.searchsorted(array.nodes, sensors)
        if not at_node.any():  # closed, and all by itself: begun somewhere
            at_node[[0, -1]], numbers[[0, -1]] = True, len(is_node)
            is_node.append(False)
        marks.append(first[-1] + knot[at_node])
        nodes.append(numbers[at_node])
        first.append(first[-1] + int(knot[-1]) + 1)
    return Layout(
        arc=np.concatenate(arcs),
        first=np.array(first),
        closed=np.array([c.closed for c in curves]),
        boundary=np.array([c.boundary for c in curves]),
        marks=np.concatenate(marks),
        nodes=np.concatenate(nodes).astype(np.int64),
        is_node=np.array(is_node),
    )


def _sensor_rows(array: SensorArray, curves: Sequence[SensorCurve], pieces: Sequence[Ints]) -> Ints:
    """A row (s,) of every sensor; of those that curves share, one of them."""
    rows = np.empty(array.sensor_count, np.int64)
    first = 0
    for curve, count in zip(curves, pieces, strict=True):
        knot = first + np.concatenate([[0], np.cumsum(count)])
        rows[curve.sensors] = knot[: len(curve.sensors)]
        first = int(knot[-1]) + 1
    return rows
