"""From a scan to a curve network: every step of thesis chapter 3 in order."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.assembly import assemble_network, per_point
from tracemesh.geometry.curves.closing import Closed, close_network
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.measured_scan import MeasuredScan
from tracemesh.geometry.curves.network_report import Misfit, bias_report, find_misfits
from tracemesh.geometry.curves.placement import PlacedCurve, uniform_layout
from tracemesh.geometry.curves.polyline import points_on_polyline
from tracemesh.geometry.curves.positions import Positions, solve_positions
from tracemesh.geometry.curves.quadrature import edge_vectors
from tracemesh.geometry.curves.regression import Regression, RegressionSolver
from tracemesh.geometry.curves.resampling import PREFILTER, resample
from tracemesh.geometry.curves.samples import Layout, NetworkSamples
from tracemesh.geometry.curves.uncertainty import point_uncertainty
from tracemesh.geometry.curves.weights import choose_weights
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.scan import Scan, curve_name

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Progress = Callable[[str, float], None]

_STAGES = ("measuring", "resampling", "weighing", "closing", "smoothing", "positions", "uncertainty")
_FLATTEST = 1e-3  # extent over length of the curves that a step is still derived from
_MOST_SAMPLES = 5_000_000
_WIDEST = 25.0  # steps that a pre-filter may be wide: each sample sees a bounded number of measured ones


@dataclass(frozen=True)
class NetworkParameters:
    """step: m between samples; None: step_fraction of the extent estimated from the scan. stretch, bend: smoothing
    lengths, m; None: automatic, or 0 if only the other is given. weights: automatic ones by cross-validation, or the
    thesis's lambda = mu = 1 in metres. curve_bias: estimate a rotation and a scale per curve and how far its nodes are
    from their marks: where the data speak for it, always, or never.
    prefilter: standard deviation, m, of the Gaussian with which frames are resampled; None: half a step.
    robust: Huber's loss in the regression, for scans with more outliers than cleaning can tell from the rest.
    """

    step: float | None = None
    step_fraction: float = 0.016
    prefilter: float | None = None
    stretch: float | None = None
    bend: float | None = None
    weights: Literal["auto", "thesis"] = "auto"
    curve_bias: Literal["auto", "on", "off"] = "auto"
    robust: bool = False


@dataclass(frozen=True)
class NetworkResult:
    """network: the reconstruction. frames: (n, 3, 3) [t N B] at its points, a node's being of its first curve.
    uncertainty: (n,) m, root mean square distance of each point from the truth. misfits: what does not fit
    together, worst first. report: what was done, JSON-able.
    """

    network: CurveNetwork
    frames: Floats
    uncertainty: Floats
    misfits: tuple[Misfit, ...]
    report: dict[str, object]


class _Stages:
    """Says how far the work is and how long each stage took."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._current: str | None = None
        self._start = 0.0
        self.seconds: dict[str, float] = {}

    def begin(self, name: str) -> None:
        """Close the running stage and announce the next; may raise Cancelled."""
        self.end()
        if self._progress is not None:
            self._progress(name, _STAGES.index(name) / len(_STAGES))
        self._current, self._start = name, time.perf_counter()

    def end(self) -> None:
        """Close the running stage."""
        if self._current is not None:
            self.seconds[self._current] = time.perf_counter() - self._start
            self._current = None


class NetworkReconstruction:
    """A scan made ready, so that other smoothing lengths cost only what depends on them."""

    def __init__(
        self,
        scan: Scan | MeasuredScan,
        parameters: NetworkParameters | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Do all that comes before the regression; raises ScanError naming the curve that prevents it.

        Whoever cuts one scan again and again has it measured only once, by `measured` of the first.
        """
        self._parameters = NetworkParameters() if parameters is None else parameters
        _check_parameters(self._parameters)
        self._stages = _Stages(progress)
        self._stages.begin("measuring")
        self.measured = scan if isinstance(scan, MeasuredScan) else MeasuredScan(scan)
        curves = self.measured.curves
        self._step = _step(self._parameters, self.measured)
        self._prefilter = _prefilter(self._parameters, self._step)
        self._stages.begin("resampling")
        samples = resample(curves, uniform_layout(curves, self._step), self._step, self._prefilter)
        self._stages.begin("weighing")
        self._choice = choose_weights(curves, samples, self._step)
        self._stages.begin("closing")
        self._closed = self._close(curves, samples)
        self._samples = self._closed.samples if self._closed else samples
        self._start = self._closed.start if self._closed else self._choice.frames
        self._solver = RegressionSolver(self._samples.layout)
        self._stages.end()

    def _close(self, curves: Sequence[PlacedCurve], samples: NetworkSamples) -> Closed | None:
        """The network freed from errors of whole curves; None for a polyline, which is exact as it is."""
        if self.measured.network.is_polyline:
            return None
        return close_network(curves, samples, self._choice, self._step, self._prefilter, self._parameters.curve_bias)

    def solve(self, weights: Weights | None = None) -> NetworkResult:
        """The network, smoothed with the chosen weights or with others; the latter starts from the solution before."""
        layout = self._samples.layout
        used = weights or wanted_weights(self._parameters) or self._choice.weights
        self._stages.begin("smoothing")
        regression = self._solver.solve(self._samples.frames, used, self._start, self._parameters.robust)
        self._stages.begin("positions")
        positions = self._positions(layout, regression.frames)
        self._stages.begin("uncertainty")
        uncertainty = per_point(layout, self._uncertainty(layout, positions, regression.frames))
        network = assemble_network(layout, positions.points, regression.frames, uncertainty, self.measured.indices)
        loose = len(network.nodes) - len(self.measured.known_nodes)
        network = replace(network, node_numbers=np.append(self.measured.known_nodes, np.full(loose, -1)))
        self._stages.end()
        misfits = self._misfits(layout, positions)
        report = self._report(network, regression, positions, used, uncertainty)
        report["warnings"] = [misfit.warning(curve_name(misfit.curve)) for misfit in misfits]
        return NetworkResult(network, per_point(layout, regression.frames), uncertainty, misfits, report)

    def _uncertainty(self, layout: Layout, positions: Positions, frames: Floats) -> Floats:
        if self._closed is None:
            return np.full(layout.size, self.measured.network.chord_residual)
        closing, tangent = self._closed.closing, frames[:, :, 0]
        expected = point_uncertainty(closing.adjustment, layout, positions.points, tangent, closing.walk)
        return expected * closing.noise_factor(layout, positions.gaps)

    def _positions(self, layout: Layout, frames: Floats) -> Positions:
        if self.measured.network.is_polyline:
            return Positions(points_on_polyline(self.measured.network, layout), self.measured.network.positions.gaps)
        covariance = self._closed.closing.covariance(layout) if self._closed else None
        return solve_positions(layout, edge_vectors(layout, frames), covariance)

    def _misfits(self, layout: Layout, positions: Positions) -> tuple[Misfit, ...]:
        if self._closed is None:
            return ()
        return find_misfits(layout, positions.gaps, self._closed.closing.expected_gaps(layout), self.measured.indices)

    def _report(
        self,
        network: CurveNetwork,
        regression: Regression,
        positions: Positions,
        weights: Weights,
        uncertainty: Floats,
    ) -> dict[str, object]:
        layout, polyline = self._samples.layout, self.measured.network.is_polyline
        gaps = np.linalg.norm(positions.gaps, axis=1)
        return {
            "parameters": {
                "step_m": self._step,
                "prefilter_m": self._prefilter,
                "stretch_m": weights.stretch,
                "bend_m": weights.bend,
                "robust": self._parameters.robust,
                "curve_bias": "on" if self._closed and self._closed.found.variances.with_bias else "off",
                "tangents": "chords to the next sample" if polyline else "tangents of the curve",
            },
            "sizes": {
                "curves": len(self.measured.cleaned),
                "samples": sum(c.samples for c in self.measured.cleaned),
                "outliers": sum(c.dropped for c in self.measured.cleaned),
                "points": len(network.points),
                "nodes": len(network.nodes),
                "segments": len(network.segments),
                "length_m": float(layout.lengths.sum()),
                "diagonal_m": network.diagonal,
                "extent_m": self.measured.network.extent,
            },
            "frame_noise_deg": float(np.rad2deg(self._choice.noise)),
            "curve_bias": bias_report(self._closed.found if self._closed else None, self.measured.indices),
            "closure": {"rms_m": float(np.sqrt(np.mean(gaps**2))), "max_m": float(gaps.max())},
            "uncertainty": {"mean_m": float(uncertainty.mean()), "max_m": float(uncertainty.max())},
            "regression": {"energy": regression.energy, "iterations": regression.iterations},
            "seconds": dict(self._stages.seconds),
        }


def _check_parameters(parameters: NetworkParameters) -> None:
    for name in ("step", "step_fraction", "prefilter", "stretch", "bend"):
        value = getattr(parameters, name)
        least_is_zero = name in ("stretch", "bend")
        if value is not None and not (np.isfinite(value) and (value > 0 or (value == 0 and least_is_zero))):
            raise ScanError(
                f"{name} must be a {'number of at least 0' if least_is_zero else 'positive number'}, got {value}"
            )


def _step(parameters: NetworkParameters, measured: MeasuredScan) -> float:
    length = sum(curve.length for curve in measured.curves)
    step = parameters.step_fraction * max(measured.network.extent, _FLATTEST * length)
    step = step if parameters.step is None else parameters.step
    if step > length:
        raise ScanError(f"a step of {step:.3g} m is longer than all curves together, {length:.3g} m")
    if length / step > _MOST_SAMPLES:
        raise ScanError(
            f"a step of {step:.3g} m would cut the curves, {length:.3g} m long, into more than {_MOST_SAMPLES} samples"
        )
    return step


def _prefilter(parameters: NetworkParameters, step: float) -> float:
    wanted = parameters.prefilter
    if wanted is not None and wanted > _WIDEST * step:
        raise ScanError(f"wanted a pre-filter of at most {_WIDEST:g} steps, {_WIDEST * step:.3g} m, got {wanted:.3g} m")
    return PREFILTER * step if wanted is None else wanted


def wanted_weights(parameters: NetworkParameters) -> Weights | None:
    """The weights that somebody chose; None: automatic ones."""
    if parameters.weights == "thesis":
        return Weights(1.0, 1.0)
    if parameters.stretch is None and parameters.bend is None:
        return None
    return Weights(parameters.stretch or 0.0, parameters.bend or 0.0)


def reconstruct_network(
    scan: Scan, parameters: NetworkParameters | None = None, progress: Progress | None = None
) -> NetworkResult:
    """Curve network of a scan; raises ScanError naming the curve, and whatever `progress` raises between stages."""
    return NetworkReconstruction(scan, parameters, progress).solve()
