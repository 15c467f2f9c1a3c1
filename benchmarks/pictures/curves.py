"""Pictures of the way from raw samples to a curve network."""

import numpy as np
from matplotlib.figure import Figure

from benchmarks.accuracy import network_error
from benchmarks.data import noisy_scan
from benchmarks.measuring import Floats, paired_motion
from benchmarks.nodes import TOLERANCE, marked_meetings, matches, proposed_meetings, without_marks
from benchmarks.noisy import partners
from benchmarks.pictures.canvas import BLUE, CURVES, GREEN, GREY, INK, ORANGE, Axes, draw_network, figure, plane, space
from benchmarks.regression import regression_problem
from benchmarks.truths import CurveTruth
from tracemesh.geometry.curves.cleaning import clean_curves, outliers
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.curves.regression import RegressionSolver
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.nodes.node_inference import InferredNodes, infer_nodes, mark_nodes
from tracemesh.geometry.rotations import align_signs, darboux_frames, matrix_to_quaternion, normalized
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import plan_scan, simulate_scan

STEP = 0.015
AXES = ("t", "N", "B")


def orientation() -> Figure:
    """What the sensors say, and the frames along the curves that follow from it."""
    drawn = figure()
    result = reconstruct_network(noisy_scan("leaf").scan)
    points = result.network.points
    axes = space(drawn, points, 121, "frames A = [t N B]")
    draw_network(axes, result.network, GREY, 0.8)
    for k, (name, colour) in enumerate(zip(AXES, (ORANGE, BLUE, GREEN), strict=True)):
        axes.quiver(*points[::6].T, *(0.045 * result.frames[::6, :, k].T), color=colour, linewidth=0.8)
        axes.plot([], [], [], color=colour, label=name)
    axes.legend(fontsize=7, frameon=False, loc="lower left", ncols=3)
    plan = plan_scan(leaf(), seed=1)
    time = np.linspace(10, 25, 900)
    readings = plan.readings(time, np.random.default_rng(1))
    right = plane(drawn, 122, "what the sensors say along the boundary", "s", "counts")
    for name, vectors, colour in (
        ("acceleration", readings.acceleration, BLUE),
        ("magnetic", readings.magnetic, ORANGE),
    ):
        right.plot(time, vectors, ".", ms=1.5, color=colour)
        right.plot([], [], "o", ms=3, color=colour, label=name)
    right.set_ylim(-18000, 23000)
    right.legend(fontsize=7, frameon=False, loc="upper right", ncols=2)
    return drawn


def cleaning() -> Figure:
    """Samples that are left out, and what the rest says."""
    drawn = figure()
    curve = noisy_scan("leaf").scan.curves[0]
    frames = darboux_frames(normalized(curve.tangent), curve.normal)
    bad, quaternion = outliers(curve, frames), align_signs(matrix_to_quaternion(frames))
    axes = plane(drawn, 111, f"{bad.sum()} of {len(bad)} samples left out", "distance, m", "quaternion")
    for k, colour in enumerate(CURVES[:4]):
        axes.plot(curve.distance[~bad], quaternion[~bad, k], ".", ms=1.5, color=colour)
        axes.plot(curve.distance[bad], quaternion[bad, k], "x", ms=6, color=INK)
    return drawn


def resampling() -> Figure:
    """Raw samples and evenly spaced ones of the first part of a curve."""
    drawn = figure()
    scan = noisy_scan("leaf").scan
    cleaned = clean_curves(scan.curves)[0]
    samples = regression_problem(scan, STEP)
    rows = slice(0, samples.layout.first[1])
    axes = plane(drawn, 111, "normals of one curve, raw and resampled", "distance, m", "N")
    for k, colour in enumerate(CURVES[:3]):
        axes.plot(scan.curves[0].distance, scan.curves[0].normal[:, k], ".", ms=1, color=GREY)
        arc = samples.layout.arc[rows] + cleaned.marks[0]
        axes.plot(arc, samples.frames[rows, k, 1], "o-", ms=2.5, lw=0.8, color=colour)
    _mark_nodes(axes, cleaned.marks)
    axes.set_xlim(0, 0.8)
    return drawn


def regression() -> Figure:
    """One component of the normals before and after smoothing with different weights."""
    drawn = figure()
    samples = regression_problem(noisy_scan("leaf").scan, STEP)
    rows = slice(0, samples.layout.first[1])
    arc = samples.layout.arc[rows]
    axes = plane(drawn, 111, "x component of the normals along the boundary", "arc length, m", "N")
    axes.plot(arc, samples.frames[rows, 0, 1], ".", ms=4, color=GREY, label="resampled")
    for bend, colour in ((0.03, GREEN), (0.1, BLUE), (0.3, ORANGE)):
        frames = RegressionSolver(samples.layout).solve(samples.frames, Weights(0.0, bend)).frames
        axes.plot(arc, frames[rows, 0, 1], lw=1.2, color=colour, label=f"bend = {bend:g} m")
    _mark_nodes(axes, arc[samples.layout.marks[samples.layout.marks < rows.stop]])
    axes.legend(fontsize=7, frameon=False)
    return drawn


def weights() -> Figure:
    """Error against the smoothing length, and the length that cross-validation chooses without knowing the truth."""
    drawn = figure()
    axes = plane(drawn, 111, "cross-validation does not know the truth", "bend, m", "mean error, % of the diagonal")
    for name, colour in (("leaf", GREEN), ("torus", BLUE), ("cone", ORANGE)):
        known = noisy_scan(name)
        truth, bends = CurveTruth.of(known.truth), np.geomspace(0.01, 0.5, 14)
        errors = [
            network_error(
                reconstruct_network(known.scan, NetworkParameters(stretch=0.0, bend=b)).network, truth, known.diagonal
            ).mean
            for b in bends
        ]
        axes.loglog(bends, errors, ".-", lw=1, color=colour, label=name)
        result = reconstruct_network(known.scan)
        chosen = result.report["parameters"]
        assert isinstance(chosen, dict)
        error = network_error(result.network, truth, known.diagonal).mean
        axes.plot(chosen["bend_m"], error, "*", ms=13, color=colour)
    axes.legend(title="★ automatic choice", fontsize=7, title_fontsize=7, frameon=False)
    return drawn


def positions() -> Figure:
    """Tangents integrated curve by curve from its first node, and all curves solved for at once."""
    drawn = figure()
    result = reconstruct_network(noisy_scan("leaf").scan, NetworkParameters(curve_bias="off"))
    integrated = _integrated(result.network, result.frames[:, :, 0])
    everything = np.concatenate([result.network.points, *integrated])
    for position, title in ((121, "tangents integrated"), (122, "all curves at once")):
        axes = space(drawn, everything, position, title)
        if position == 121:
            for k, line in enumerate(integrated):
                axes.plot(*line.T, lw=1.6, color=CURVES[k % len(CURVES)])
        else:
            draw_network(axes, result.network, None)
    return drawn


def reconstruction() -> Figure:
    """The network of a noisy scan, coloured by the uncertainty of its points."""
    drawn = figure(5.0)
    result = reconstruct_network(noisy_scan("leaf").scan)
    points, uncertainty = result.network.points, 1e3 * result.uncertainty
    axes = space(drawn, points)
    draw_network(axes, result.network, GREY, 0.8)
    dots = axes.scatter(*points.T, s=8, c=uncertainty, vmin=0, depthshade=False, zorder=4)
    bar = drawn.colorbar(dots, ax=axes, shrink=0.7, pad=0.02)
    bar.set_label("standard uncertainty, mm", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    return drawn


def bias() -> Figure:
    """Error along all curves without and with a heading and a scale per curve."""
    drawn = figure()
    known = noisy_scan("leaf")
    axes = plane(drawn, 111, "distance to the true place of every point", "points along all curves", "mm")
    plain, corrected = NetworkParameters(curve_bias="off"), NetworkParameters(curve_bias="on")
    for label, chosen, colour in (("without", plain, ORANGE), ("with heading and scale per curve", corrected, BLUE)):
        network = reconstruct_network(known.scan, chosen).network
        axes.plot(1e3 * _true_errors(network, known.truth)[_along(network)], lw=1.2, color=colour, label=label)
    axes.legend(fontsize=7, frameon=False)
    return drawn


def uncertainty() -> Figure:
    """True error and stated uncertainty along all curves."""
    drawn = figure()
    known = noisy_scan("leaf")
    result = reconstruct_network(known.scan)
    error, order = _true_errors(result.network, known.truth), _along(result.network)
    axes = plane(drawn, 111, "distance to the true place of every point", "points along all curves", "mm")
    axes.fill_between(
        np.arange(len(order)), 0, 2e3 * result.uncertainty[order], color=BLUE, alpha=0.15, lw=0, label="2 u"
    )
    axes.plot(1e3 * result.uncertainty[order], lw=1, color=BLUE, label="u, stated")
    axes.plot(1e3 * error[order], ".", ms=3, color=ORANGE, label="error")
    axes.legend(fontsize=7, frameon=False)
    return drawn


def node_inference() -> Figure:
    """The network over nodes that nobody marked, and how sure and how right such nodes are."""
    drawn = figure()
    scan = noisy_scan("leaf").scan
    inferred = infer_nodes(without_marks(scan))
    network = reconstruct_network(mark_nodes(scan, inferred.proposals)).network
    axes = space(drawn, network.points, 121, f"{len(inferred.proposals)} nodes that nobody marked")
    draw_network(axes, network, None)
    axes.scatter(*network.points[network.nodes].T, s=14, color=INK, depthshade=False, zorder=3)
    right = plane(
        drawn, 122, "proposed meetings; above the line there is none", "confidence", "mm from the operator's mark"
    )
    for name, colour in zip(("leaf", "sphere", "torus", "cone", "egg"), CURVES, strict=False):
        sure = _sureness(noisy_scan(name).scan)
        right.plot(*sure.T, "o", ms=5, color=colour, alpha=0.6, label=name)
    right.axhline(1e3 * TOLERANCE, lw=0.6, ls=":", color=INK)
    right.set_xlim(0, 1.02)
    right.legend(fontsize=7, frameon=False)
    return drawn


def simulation() -> Figure:
    """Motion and odometer of a simulated session."""
    drawn = figure()
    plan = plan_scan(leaf(), seed=1)
    left = plane(drawn, 121, "speed: pauses at nodes, ways between curves", "s", "m/s")
    left.plot(plan.time, plan.speed, lw=0.8, color=BLUE)
    right = plane(drawn, 122, "what a host at 60 Hz records", "s", "acceleration, B axis (counts)")
    for k, curve in enumerate(simulate_scan(plan, seed=1)):
        right.plot(curve.time, curve.readings.acceleration[:, 2], ".", ms=1, color=CURVES[k % len(CURVES)])
        right.plot(
            curve.time[curve.node_samples], curve.readings.acceleration[curve.node_samples, 2], "o", ms=4, color=INK
        )
    return drawn


def _sureness(scan: Scan) -> Floats:
    """Confidence and error (k, 2), the latter in mm, of every proposed meeting; those that are none end at the top."""
    rows, true, most = [], marked_meetings(scan), 1.5 * TOLERANCE
    for proposal in infer_nodes(without_marks(scan)).proposals:
        for meeting in proposed_meetings(scan, InferredNodes((proposal,), ())):
            errors = list(matches(scan, true, [meeting]).values())
            rows.append((proposal.confidence, 1e3 * (errors[0] if errors else most)))
    return np.array(rows)


def _mark_nodes(axes: Axes, places: Floats) -> None:
    for place in places:
        axes.axvline(place, lw=0.6, ls=":", color=INK)


def _integrated(network: CurveNetwork, tangents: Floats) -> list[Floats]:
    """Every curve from the true place of its first point, by the trapezoidal rule."""
    curves: dict[int, list[int]] = {}
    for segment in network.segments:
        known = curves.setdefault(segment.curve, [])
        known += segment.points[1 if known else 0 :].tolist()
    lines = []
    for index in curves.values():
        length = np.linalg.norm(np.diff(network.points[index], axis=0), axis=1, keepdims=True)
        steps = length * (tangents[index][1:] + tangents[index][:-1]) / 2
        lines.append(network.points[index[0]] + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]))
    return lines


def _along(network: CurveNetwork) -> Floats:
    return np.concatenate([s.points[:-1] for s in network.segments])


def _true_errors(network: CurveNetwork, truth: CurveNetwork) -> Floats:
    there = partners(network, truth)
    return np.asarray(np.linalg.norm(paired_motion(network.points, there).apply(network.points) - there, axis=1))
