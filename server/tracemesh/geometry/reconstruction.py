"""From a scan to a curve network: every step of thesis chapter 3 in order."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tracemesh.errors import ScanError
from tracemesh.geometry.assembly import assemble_network, per_point
from tracemesh.geometry.cleaning import clean_curves
from tracemesh.geometry.energy import Weights
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.placement import PlacedCurve, measured_layout, place_curve, uniform_layout
from tracemesh.geometry.polyline import measure_network, points_on_polyline
from tracemesh.geometry.positions import arc_edges, check_connected, solve_positions
from tracemesh.geometry.regression import RegressionSolver
from tracemesh.geometry.resampling import resample
from tracemesh.geometry.scan import Scan

Floats = NDArray[np.float64]
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class NetworkParameters:
    """step: m between samples; None: step_fraction of the diagonal estimated from the scan. stretch, bend: smoothing
    lengths, m; None: automatic. weights: automatic ones by cross-validation, or the thesis's lambda = mu = 1.
    curve_bias: estimate a heading and a scale per curve always, never, or where the data speak for it.
    """

    step: float | None = None
    step_fraction: float = 0.016
    stretch: float | None = None
    bend: float | None = None
    weights: Literal["auto", "thesis"] = "auto"
    curve_bias: Literal["auto", "on", "off"] = "auto"


@dataclass(frozen=True)
class NetworkResult:
    """network: the reconstruction. frames: (n, 3, 3) [t N B] at its points, those of a node being of its first curve.
    report: what was done, JSON-able. uncertainty: (n,) m, standard uncertainty of each point, or None.
    """

    network: CurveNetwork
    frames: Floats
    report: dict[str, object]
    uncertainty: Floats | None


class _Stages:
    """Tells how far the work is and how long each stage took."""

    def __init__(self, names: tuple[str, ...], progress: Progress | None) -> None:
        self._names, self._progress = names, progress
        self._start = time.perf_counter()
        self.seconds: dict[str, float] = {}

    def begin(self, name: str) -> None:
        """Close the running stage and announce the next; may raise Cancelled."""
        self.end()
        self._current, self._start = name, time.perf_counter()
        if self._progress is not None:
            self._progress(name, self._names.index(name) / len(self._names))

    def end(self) -> None:
        """Close the running stage."""
        if hasattr(self, "_current"):
            self.seconds[self._current] = time.perf_counter() - self._start


_STAGES = ("cleaning", "measuring", "resampling", "smoothing", "positions", "assembly")


def _placed(scan: Scan) -> tuple[PlacedCurve, ...]:
    if not scan.curves:
        raise ScanError("the scan holds no curve")
    return tuple(place_curve(curve) for curve in clean_curves(scan.curves))


def reconstruct_network(
    scan: Scan, parameters: NetworkParameters | None = None, progress: Progress | None = None
) -> NetworkResult:
    """Curve network of a scan; raises ScanError naming the curve, and whatever `progress` raises between stages."""
    chosen = NetworkParameters() if parameters is None else parameters
    stages = _Stages(_STAGES, progress)
    stages.begin("cleaning")
    curves = _placed(scan)
    indices = np.array([c.index for c in curves])
    stages.begin("measuring")
    check_connected(measured_layout(curves), indices)
    measured = measure_network(curves)
    step = chosen.step if chosen.step is not None else chosen.step_fraction * measured.diagonal
    stages.begin("resampling")
    layout = uniform_layout(curves, step)
    samples = resample(curves, layout, step)
    stages.begin("smoothing")
    weights = Weights(0.0, 2 * step)
    regression = RegressionSolver(layout).solve(samples.frames, weights)
    stages.begin("positions")
    if measured.is_polyline:
        points = points_on_polyline(measured, layout)
    else:
        points = solve_positions(layout, arc_edges(layout, regression.frames)).points
    stages.begin("assembly")
    network = assemble_network(layout, points, regression.frames, indices)
    stages.end()
    report: dict[str, object] = {"stages": stages.seconds}
    return NetworkResult(network, per_point(layout, regression.frames), report, None)
