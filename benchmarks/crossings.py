"""What smoothness at nodes is worth: bends that end there, bends that go through, and equations across curves."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, triu
from scipy.sparse.linalg import splu

from benchmarks.accuracy import network_error
from benchmarks.data import Data, KnownScan, noisy_scan
from benchmarks.measuring import Floats, Ints, paired_motion
from benchmarks.noisy import at_partners, partners
from benchmarks.table import Cell, Column, Table
from benchmarks.truths import CurveTruth
from tracemesh.geometry.curves.assembly import assemble_network
from tracemesh.geometry.curves.cleaning import clean_curves
from tracemesh.geometry.curves.closing import close_network
from tracemesh.geometry.curves.energy import EnergyPoint, Weights, pattern_of
from tracemesh.geometry.curves.placement import measured_layout, place_curve, uniform_layout
from tracemesh.geometry.curves.polyline import measure_network
from tracemesh.geometry.curves.positions import solve_positions
from tracemesh.geometry.curves.quadrature import edge_vectors
from tracemesh.geometry.curves.reconstruction import NetworkParameters
from tracemesh.geometry.curves.regression import RegressionSolver
from tracemesh.geometry.curves.resampling import PREFILTER, resample
from tracemesh.geometry.curves.samples import Bools, Layout, NetworkSamples
from tracemesh.geometry.curves.stencil import Stencil
from tracemesh.geometry.curves.weights import choose_weights
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.rotations import hat
from tracemesh.geometry.simulated.shapes import SHAPES

_LEAST_TURN = 1e-9  # rad; a smaller step ends an iteration
_MOST_STEPS = 50
_SYMMETRIC_ROUNDS = 3
_ALIKE = 1e-10  # relative; singular values below it are equations that others imply

WAYS = ("end", "through", "symmetric")

NOTE = """Three ways to treat curves at nodes, everything else being alike and automatic. End: bends are not counted at
    nodes. Through: they are, as everywhere else on a curve; this is what tracemesh does. Symmetric: through, and for
    every two curves i, j at a node N'_i t_j = N'_j t_i holds exactly, the limit of any weight on it. Roughness: second
    derivative of the normal along a curve at nodes, over that between nodes, both rms. Asymmetry: rms of
    N'_i t_j - N'_j t_i, 1/m. Nodes, all: rms angle of normals from the true ones at nodes and everywhere, after rigid
    registration of the points. Positions: mean distance to the true curves, % of the diagonal. Figures of several scans
    are root mean squares."""


@dataclass(frozen=True)
class Problem:
    """What the regression of a scan is given, all choices automatic; covariance: of segment vectors, m^2."""

    samples: NetworkSamples
    start: Floats
    weights: Weights
    covariance: Floats | None

    @classmethod
    def of(cls, known: KnownScan) -> "Problem":
        curves = tuple(place_curve(curve) for curve in clean_curves(known.scan.curves))
        step = NetworkParameters().step_fraction * measure_network(curves, measured_layout(curves)).extent
        samples = resample(curves, uniform_layout(curves, step), step)
        choice = choose_weights(curves, samples, step)
        closed = close_network(curves, samples, choice, step, PREFILTER * step, "auto")
        covariance = closed.closing.covariance(closed.samples.layout)
        return cls(closed.samples, closed.start, choice.weights, covariance)

    def network(self, frames: Floats) -> CurveNetwork:
        """The network of frames (n, 3, 3) at the layout's rows."""
        layout = self.samples.layout
        positions = solve_positions(layout, edge_vectors(layout, frames), self.covariance)
        return assemble_network(layout, positions.points, frames, None, np.arange(len(layout.closed)))


class EndingStencil(Stencil):
    """Couplings without the bends that are centred at nodes."""

    def __init__(self, layout: Layout) -> None:
        super().__init__(layout)
        kept = ~at_nodes(self, layout)
        for name in ("centre", "edge_in", "edge_out", "before", "after", "h_in", "h_out"):
            setattr(self, name, getattr(self, name)[kept])


def at_nodes(stencil: Stencil, layout: Layout) -> Bools:
    """Which (b,) bends are centred at a node."""
    return np.isin(stencil.centre, stencil.row[layout.marks[layout.is_node[layout.nodes]]])


def minimised(stencil: Stencil, data: Floats, weights: Weights, start: Floats) -> Floats:
    """Frames (u, 3, 3) of least energy, by plain Gauss-Newton from a start near them."""
    x = start
    for _ in range(_MOST_STEPS):
        point = EnergyPoint(stencil, x, data, weights)
        step = splu(hessian(stencil, point)).solve(point.gradient().ravel()).reshape(-1, 3)
        x = point.moved(-step)
        if np.abs(step).max() < _LEAST_TURN:
            break
    return x


def hessian(stencil: Stencil, point: EnergyPoint) -> csc_array:
    """Second-order model (3u, 3u) of the energy."""
    pattern = pattern_of(stencil)
    pattern.matrix.data = pattern.entries(point.hessian_blocks())
    return csc_array(pattern.matrix + triu(pattern.matrix, 1).T)


class ShapeOperator:
    """Its symmetry at nodes, N'_p . t_q = N'_q . t_p for every two curves p, q that meet there.

    A normal's derivative is that of the parabola through three frames of its own curve: the one at the node and its
    neighbours, or the next two where the curve ends.
    """

    def __init__(self, stencil: Stencil) -> None:
        s = stencil
        self._three, self._factor = np.full((s.size, 3), -1), np.zeros((s.size, 3))
        for unknown, place in ((s.after, s.h_out), (s.before, -s.h_in), (s.centre, 0 * s.h_in)):
            self._three[unknown] = np.stack([s.before, s.centre, s.after], axis=1)
            self._factor[unknown] = _slope(s.h_in, s.h_out, place)
        self._pair = s.pair[(self._three[s.pair] >= 0).all(axis=(1, 2))]

    def defect(self, x: Floats) -> Floats:
        """N'_p . t_q - N'_q . t_p (e,), 1/m, for frames (u, 3, 3)."""
        p, q = self._pair.T
        return np.asarray(np.sum(self._rate(x, p) * x[q, :, 0] - self._rate(x, q) * x[p, :, 0], axis=1))

    def derivative(self, x: Floats) -> Floats:
        """Derivative (e, 3u) of the defect with respect to w in X exp(w)."""
        result = np.zeros((len(self._pair), len(x), 3))
        rows = np.arange(len(self._pair))
        for sign, p, q in ((1.0, *self._pair.T), (-1.0, *self._pair[:, ::-1].T)):
            result[rows, q] -= sign * np.einsum("ei,eij->ej", self._rate(x, p), x[q] @ hat(np.eye(3)[0]))
            for k in range(3):
                j, factor = self._three[p, k], sign * self._factor[p, k, None]
                result[rows, j] -= factor * np.einsum("ei,eij->ej", x[q, :, 0], x[j] @ hat(np.eye(3)[1]))
        return result.reshape(len(rows), -1)

    def _rate(self, x: Floats, unknown: Ints) -> Floats:
        """Derivative (e, 3), 1/m, of normals along their curves."""
        return np.asarray(np.einsum("ek,eki->ei", self._factor[unknown], x[self._three[unknown], :, 1]))


def _slope(h_in: Floats, h_out: Floats, place: Floats) -> Floats:
    """Factors (b, 3) of values at -h_in, 0 and h_out in the derivative at a place of the parabola through them."""
    whole = h_in + h_out
    before = (2 * place - h_out) / (h_in * whole)
    after = (2 * place + h_in) / (h_out * whole)
    return np.stack([before, -before - after, after], axis=1)


def symmetric(stencil: Stencil, data: Floats, weights: Weights, start: Floats) -> Floats:
    """Frames (u, 3, 3) of least energy among those with a symmetric shape operator at every node."""
    x, operator = start, ShapeOperator(stencil)
    for _ in range(_SYMMETRIC_ROUNDS):
        point = EnergyPoint(stencil, x, data, weights)
        factors, rows = splu(hessian(stencil, point)), operator.derivative(x)
        free, moved = factors.solve(point.gradient().ravel()), factors.solve(rows.T)
        push = np.linalg.lstsq(rows @ moved, operator.defect(x) - rows @ free, rcond=_ALIKE)[0]
        x = point.moved(-(free + moved @ push).reshape(-1, 3))
    return x


def curvature_of_normals(stencil: Stencil, x: Floats) -> Floats:
    """How much the derivative of the normal changes at each bend (b,), over the mean of its edges, 1/m^2."""
    s, n = stencil, x[:, :, 1]
    ahead, behind = n[s.after] - n[s.centre], n[s.centre] - n[s.before]
    change = ahead / s.h_out[:, None] - behind / s.h_in[:, None]
    return np.asarray(np.linalg.norm(change, axis=1) * 2 / (s.h_in + s.h_out))


def crossings(data: Data, names: tuple[str, ...] = tuple(SHAPES), seeds: int = 10) -> Table:
    """Table of roughness and errors at nodes; names: of built-in shapes, each scanned `seeds` times."""
    scans = {f"{name} (built in), {seeds} scans": [noisy_scan(name, k) for k in range(1, seeds + 1)] for name in names}
    scans |= {known.name: [known] for known in data.scans("noisy")}
    columns = (
        Column("noisy scan"),
        *(Column(f"roughness: {way}", ".2f") for way in WAYS[:2]),
        Column("asymmetry: through", ".3f"),
        *(Column(f"nodes, degrees: {way}", ".3f") for way in WAYS),
        *(Column(f"all, degrees: {way}", ".3f") for way in WAYS),
        *(Column(f"positions, %: {way}", ".4f") for way in WAYS),
    )
    rows: tuple[tuple[Cell, ...], ...] = tuple((name, *_figures(each)) for name, each in scans.items())
    return Table("crossings", "Smoothness of normals at nodes", columns, rows, (NOTE,))


def _figures(scans: list[KnownScan]) -> list[float]:
    """Root mean squares of the figures of scans."""
    return [float(figure) for figure in np.sqrt(np.mean([_squares(known) for known in scans], axis=0))]


def _squares(known: KnownScan) -> list[float]:
    """Squares of the figures of a row of the table."""
    problem = Problem.of(known)
    layout, data = problem.samples.layout, problem.samples.frames
    stencil = Stencil(layout)
    kept = data[stencil.representative]
    frames = RegressionSolver(layout).solve(data, problem.weights, problem.start).frames
    through = frames[stencil.representative]
    found = [
        minimised(EndingStencil(layout), kept, problem.weights, through),
        through,
        symmetric(stencil, kept, problem.weights, through),
    ]
    operator, there = ShapeOperator(stencil), at_nodes(stencil, layout)
    second = [curvature_of_normals(stencil, x) ** 2 for x in found[:2]]
    roughness = [float(np.mean(each[there]) / np.mean(each[~there])) for each in second]
    asymmetry = float(np.mean(operator.defect(through) ** 2))
    errors = np.array([_errors(known, problem.network(x[stencil.row])) for x in found])
    return [*roughness, asymmetry, *(errors.T**2).ravel()]


def _errors(known: KnownScan, network: CurveNetwork) -> tuple[float, float, float]:
    """Errors of normals at nodes and of all, rms, degrees; mean error of positions, % of the diagonal."""
    motion = paired_motion(network.points, partners(network, known.truth))
    normals = at_partners(network, known.truth, known.truth.normals)
    cosine = np.sum(normals * (network.normals @ motion.rotation.T), axis=1) / np.linalg.norm(normals, axis=1)
    angle = np.degrees(np.arccos(np.minimum(cosine, 1)))
    of_nodes, of_all = (float(np.sqrt(np.mean(a**2))) for a in (angle[network.nodes], angle))
    return of_nodes, of_all, network_error(network, CurveTruth.of(known.truth), known.diagonal).mean
