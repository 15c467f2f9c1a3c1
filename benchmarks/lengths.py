"""Where distance comes from: a wheel, or time with or without measured lengths, as in the thesis's figure 3.14."""

from dataclasses import replace

import numpy as np

from benchmarks.accuracy import network_error
from benchmarks.data import Data, built_in, exact_network
from benchmarks.table import Cell, Column, Table
from benchmarks.truths import CurveTruth
from tracemesh.formats.recordings import Recording, recording_from_simulation, scan_from_recordings
from tracemesh.geometry.curves.reconstruction import reconstruct_network
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shape_curves import ShapeCurve
from tracemesh.geometry.simulated.shapes import SHAPES, Shape
from tracemesh.geometry.simulated.simulation import plan_scan, simulate_scan
from tracemesh.wire.device import Samples

NOTE = """Mean distance of the network's points to the true curves, % of the diagonal, after rigid registration; the
    same simulated noisy scans with several sources of distance. Wheel: ticks. Measured lengths: time, scaled to the
    true length of every segment. Constant speed: time, as the simulated hand moved but for ramps and pauses. Unknown
    speeds: durations, each segment's speed being unknown (the default where there is only time). The last two are
    scaled to the true total length, as the thesis does. The thesis reports, of a real lilium: about 1 % with the wheel
    and with measured lengths, about 2 % with constant speed."""


def lengths(data: Data, names: tuple[str, ...] = tuple(SHAPES)) -> Table:
    """Table of errors by the source of distance; names: of built-in shapes."""
    del data  # only simulated scans tell time
    columns = (
        Column("noisy scan"),
        *(Column(name, ".3f") for name in ("wheel", "measured lengths", "constant speed", "unknown speeds")),
    )
    return Table("lengths", "Where distance comes from", columns, tuple(map(_row, names)), (NOTE,))


def with_lengths(scan: Scan, curves: tuple[ShapeCurve, ...]) -> Scan:
    """The scan with distances such that the nodes are as far apart as they truly are."""
    return Scan(tuple(map(_stretched, scan.curves, curves)))


def without_wheel(recording: Recording) -> Recording:
    """The recording of a device that has no wheel."""
    bare = [m.model_copy(update={"ticks": None}) if isinstance(m, Samples) else m for m in recording.messages]
    return Recording(recording.hello, bare)


def _row(name: str) -> tuple[Cell, ...]:
    shape = built_in(name)
    recording = recording_from_simulation(simulate_scan(plan_scan(shape, seed=1), 1), name)
    timed = scan_from_recordings([without_wheel(recording)])
    measured, constant = with_lengths(timed, shape.curves), Scan(tuple(replace(c, timed=False) for c in timed.curves))
    scans = (scan_from_recordings([recording]), measured, constant, timed)
    networks = [reconstruct_network(scan).network for scan in scans]
    networks[2:] = [_scaled(network, shape) for network in networks[2:]]
    truth = exact_network(shape)
    errors = [network_error(network, CurveTruth.of(truth), truth.diagonal).mean for network in networks]
    return (f"{name} (built in)", *errors)


def _stretched(curve: CurveScan, known: ShapeCurve) -> CurveScan:
    marked = curve.distance[curve.node_samples]
    return replace(curve, distance=np.interp(curve.distance, marked, known.node_positions), timed=False)


def _scaled(network: CurveNetwork, shape: Shape) -> CurveNetwork:
    edges = [np.diff(network.points[s.points], axis=0) for s in network.segments]
    found = float(np.linalg.norm(np.concatenate(edges), axis=1).sum())
    true = sum(curve.length for curve in shape.curves)
    return replace(network, points=network.points * (true / found))
