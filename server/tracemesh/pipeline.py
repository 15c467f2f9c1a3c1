"""The whole way from a scan to a network and its surface: pure, reports its progress, can be stopped between stages."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from time import perf_counter

import numpy as np

from tracemesh.errors import InputError, PiecesError, ScanError
from tracemesh.formats.meshes import write_mesh
from tracemesh.formats.networks import write_network
from tracemesh.formats.readings import reading_of, sensor_array, sensor_rotations
from tracemesh.formats.recordings import Recording
from tracemesh.geometry.curves.array_network import ArrayNetwork, ArraySolver
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.reconstruction import (
    NetworkParameters,
    NetworkResult,
    reconstruct_network,
    wanted_weights,
)
from tracemesh.geometry.curves.sketch import give_lengths
from tracemesh.geometry.curves.spline_network import resample_network
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.nodes.node_inference import InferredNodes, NodeProposal, infer_nodes, mark_nodes
from tracemesh.geometry.scan import CurveScan, Floats, Scan, curve_name
from tracemesh.geometry.sensing.odometry import NOMINAL_SPEED
from tracemesh.geometry.sensor_array import SensorArray
from tracemesh.geometry.surfaces.surface import SurfaceParameters, span_surface
from tracemesh.wire.resources import ReconstructionParameters

Progress = Callable[[str, float], None]
"""Called with the stage in words and the fraction done (0 to 1); raises `Cancelled` to stop the work."""

NETWORK_SHARE = 0.3
"""Part of the whole work, as the progress bar shows it, that the network takes."""
LEAST_CONFIDENCE = 0.5
"""A node that was found rather than marked is used where it is likelier than not."""
MOST_DIVISIONS = 3000
"""Vertices along a network's extent: more would make a mesh of many million."""
SOFT_LENGTH = 2.0
"""Edge lengths over which a soft surface smooths its network."""
FLATTEST = 1e-3
"""Diagonal over length of an array's curves that a step is still derived from."""
WORST_GAP = 0.1
"""Of a segment's length: what an array's curves may miss one another by before somebody should know."""


@dataclass(frozen=True)
class Reconstruction:
    """What a reconstruction leaves: `mesh` is None when only the network was asked for; `report` is plain JSON; `nodes`
    are those that were found, None when they were not asked for.
    """

    network: CurveNetwork
    mesh: Mesh | None
    report: dict[str, object]
    nodes: InferredNodes | None = None

    @property
    def warnings(self) -> list[str]:
        """What a person should know of the result, in sentences."""
        parts = (self.report.get(name) for name in ("lengths", "network", "surface"))
        return [w for part in parts if isinstance(part, dict) for w in part["warnings"]]

    def mesh_file(self, extension: str = "glb") -> bytes:
        """The mesh as a file of this extension; GLB also holds the network and where it all comes from."""
        if self.mesh is None:
            raise ValueError("wanted a reconstruction with a surface, got one of the network only")
        return write_mesh(self.mesh, extension, self.network, {"generator": self.report["generator"]})

    def network_file(self) -> bytes:
        """The curve network as network JSON."""
        return write_network(self.network).encode()

    def report_file(self) -> bytes:
        """Stage times (s), sizes, parameters used, residuals, quality and warnings as JSON."""
        return (json.dumps(self.report, indent=1) + "\n").encode()


def reconstruct(
    scan: Scan,
    parameters: ReconstructionParameters | None = None,
    progress: Progress | None = None,
    lengths: Mapping[tuple[int, int], float] | None = None,
) -> Reconstruction:
    """Curve network of a scan and the surface that spans it.

    lengths: m, of segments that somebody measured, by curve and place on it (see `give_lengths`).
    Raises ScanError or NetworkError when the scan cannot be reconstructed, SurfaceError when no valid mesh spans its
    network, and whatever `progress` raises.
    """
    parameters = parameters or ReconstructionParameters()
    report = progress or _silent
    begin = perf_counter()
    found = _find_nodes(scan, report) if parameters.infer_nodes else None
    scan = give_lengths(_marked(scan, found), lengths or {})
    curves = _network(scan, parameters, _part(report, 0.0, NETWORK_SHARE))
    made = {"generator": _generator(), "lengths": _lengths_report(scan), "calibrations": _calibrations_report(scan)}
    nodes = {"nodes": _nodes_report(found)} if found else {}
    result = Reconstruction(curves.network, None, {**made, **nodes, "network": curves.report}, found)
    return _finished(result, parameters, parameters.surface, report, begin)


def reconstruct_measured(
    measured: Scan | Recording,
    parameters: ReconstructionParameters,
    progress: Progress | None = None,
    lengths: Mapping[tuple[int, int], float] | None = None,
) -> Reconstruction:
    """Of a scan, or of one reading of a fixed array's recording; raises what `reconstruct` does, and InputError for
    what only the other one has.
    """
    if isinstance(measured, Scan):
        if parameters.reading is not None:
            raise InputError("a reading can be chosen of a fixed array's recording, and this is a scan of curves")
        return reconstruct(measured, parameters, progress, lengths)
    if lengths:
        raise InputError("lengths can be given for scanned curves: an array's spacings are those of its recording")
    device = measured.hello.device
    rotations = sensor_rotations(reading_of(measured, parameters.reading), device)
    return reconstruct_reading(sensor_array(device), rotations, parameters, progress)


def reconstruct_reading(
    array: SensorArray,
    rotations: Floats,
    parameters: ReconstructionParameters | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Curve network of one reading of an array, sensor -> world (s, 3, 3), and the surface that spans it, if its curves
    enclose one. Its frames are smoothed only if smoothing lengths are given.

    Raises ScanError when it cannot be reconstructed, SurfaceError when no valid mesh spans its network, and whatever
    `progress` raises.
    """
    parameters = parameters or ReconstructionParameters()
    report = progress or _silent
    begin = perf_counter()
    if parameters.infer_nodes or parameters.curve_bias == "on":
        raise ScanError("an array's curves share their sensors: it has no nodes to find and no curve to turn")
    report("network", 0.0)
    smoothing = wanted_weights(network_parameters(parameters))
    step = _array_step(array, rotations, parameters)
    solved = ArraySolver(array, step).solve(rotations, smoothing)
    made: dict[str, object] = {"generator": _generator(), "network": _array_report(array, solved, step, smoothing)}
    surface = parameters.surface and array.encloses
    return _finished(Reconstruction(solved.network, None, made), parameters, surface, report, begin)


def _finished(
    result: Reconstruction, parameters: ReconstructionParameters, surface: bool, progress: Progress, begin: float
) -> Reconstruction:
    """With its surface, if wanted, and the time it all took since `begin`."""
    if surface:
        wanted = SurfaceParameters(_mesh_size(parameters, result.network), SOFT_LENGTH if parameters.soft else None)
        result = _with_surface(result, wanted, _part(progress, NETWORK_SHARE, 1.0))
    result.report["seconds"] = perf_counter() - begin
    progress("done", 1.0)
    return result


def _array_step(array: SensorArray, rotations: Floats, parameters: ReconstructionParameters) -> float:
    wanted = network_parameters(parameters)
    if wanted.step is not None:
        return wanted.step
    coarse = ArraySolver(array, float(max(curve.spacing.max() for curve in array.curves)))
    length = sum(float(curve.spacing.sum()) for curve in array.curves)
    return wanted.step_fraction * max(coarse.solve(rotations).network.extent, FLATTEST * length)


def _array_report(array: SensorArray, solved: ArrayNetwork, step: float, weights: Weights | None) -> dict[str, object]:
    gaps, network = np.linalg.norm(solved.gaps, axis=1), solved.network
    worst = float((gaps / solved.segment_lengths).max())
    warnings = []
    if worst > WORST_GAP:
        warnings.append(
            f"its curves miss one another by up to {100 * worst:.0f} % of the way between two nodes: "
            "are spacings and mountings what they are said to be?"
        )
    if not array.encloses:
        warnings.append("the array's curves enclose nothing: there is a network, but no surface")
    return {
        "parameters": {
            "step_m": step,
            "stretch_m": weights.stretch if weights else 0.0,
            "bend_m": weights.bend if weights else 0.0,
        },
        "sizes": {
            "curves": len(array.curves),
            "sensors": array.sensor_count,
            "points": len(network.points),
            "nodes": len(network.nodes),
            "segments": len(network.segments),
            "length_m": float(solved.segment_lengths.sum()),
            "diagonal_m": network.diagonal,
        },
        "closure": {"rms_m": float(np.sqrt(np.mean(gaps**2))), "max_m": float(gaps.max())},
        "warnings": warnings,
    }


def is_used(proposal: NodeProposal) -> bool:
    """Whether a node that was found is likely enough to be part of the network."""
    return proposal.confidence > LEAST_CONFIDENCE


def _find_nodes(scan: Scan, progress: Progress) -> InferredNodes:
    progress("nodes", 0.0)
    found = infer_nodes(scan)
    if found.unplaced:
        names = ", ".join(curve_name(i) for i in found.unplaced)
        raise ScanError(f"no place was found for {names}: mark where they meet the other curves, or leave them out")
    return found


def _marked(scan: Scan, found: InferredNodes | None) -> Scan:
    return mark_nodes(scan, [p for p in found.proposals if is_used(p)]) if found else scan


def _nodes_report(found: InferredNodes) -> dict[str, object]:
    """Curves and samples are counted from 0, as in the network's file."""
    proposals = [
        {
            "places": [{"curve": curve, "sample": sample} for curve, sample in p.places],
            "confidence": p.confidence,
            "marked": p.node is not None,
            "used": is_used(p),
        }
        for p in found.proposals
    ]
    return {"least_confidence": LEAST_CONFIDENCE, "proposals": proposals}


def _lengths_report(scan: Scan) -> dict[str, object]:
    """How the lengths of curves, counted from 0, are known."""
    given = [i for i, c in enumerate(scan.curves) if c.lengths is not None]
    timed = [i for i, c in enumerate(scan.curves) if c.timed]
    arbitrary = len(timed) == len(scan.curves) and not given
    warning = f"no length was measured: the size is that of a hand that moves at {NOMINAL_SPEED:g} m/s"
    return {
        "timed_curves": timed,
        "pauses_s": [_paused(scan.curves[i]) for i in timed],
        "curves_with_given_lengths": given,
        "warnings": [warning] if arbitrary else [],
    }


def _paused(curve: CurveScan) -> float | None:
    """s of a timed curve that count as no way."""
    if curve.time is None:
        return None
    return max(0.0, float(np.ptp(curve.time) - np.ptp(curve.distance) / NOMINAL_SPEED))


def _calibrations_report(scan: Scan) -> list[dict[str, object]]:
    """Which calibrations were applied to which curves, counted from 0; all others are as their devices sent them."""
    names = dict.fromkeys(c.calibration for c in scan.curves if c.calibration)
    return [
        {"calibration": name, "curves": [i for i, c in enumerate(scan.curves) if c.calibration == name]}
        for name in names
    ]


def _network(scan: Scan, parameters: ReconstructionParameters, progress: Progress) -> NetworkResult:
    try:
        return reconstruct_network(scan, network_parameters(parameters), progress)
    except PiecesError as error:
        if parameters.infer_nodes:
            hint = f"even with the nodes that were found with a confidence over {LEAST_CONFIDENCE}: mark more of them"
        else:
            hint = "mark where they meet, or have the nodes found (--infer-nodes)"
        raise PiecesError(f"{error}; {hint}", error.curves, error.mend) from None


def span(
    network: CurveNetwork,
    progress: Progress | None = None,
    step: float | None = None,
    parameters: ReconstructionParameters | None = None,
) -> Reconstruction:
    """Surface over a network that is known already; raises NetworkError or SurfaceError.

    step: m between points that the network's curves get first; None leaves its points as they are.
    """
    begin = perf_counter()
    network = network if step is None else resample_network(network, step)
    surface = SurfaceParameters(_mesh_size(parameters or ReconstructionParameters(), network))
    result = _with_surface(Reconstruction(network, None, {"generator": _generator()}), surface, progress or _silent)
    result.report["seconds"] = perf_counter() - begin
    return result


def network_parameters(parameters: ReconstructionParameters) -> NetworkParameters:
    """The kernel's parameters for what a person chose."""
    number, relative = _number(parameters.step)
    return NetworkParameters(
        step=None if relative else number,
        step_fraction=number / 100 if relative else NetworkParameters.step_fraction,
        prefilter=parameters.prefilter,
        stretch=parameters.stretch,
        bend=parameters.bend,
        weights=parameters.weights,
        curve_bias=parameters.curve_bias,
        robust=parameters.robust,
    )


def _mesh_size(parameters: ReconstructionParameters, network: CurveNetwork) -> float | None:
    if parameters.mesh_size is None:
        return None
    number, relative = _number(parameters.mesh_size)
    size = number / 100 * network.extent if relative else number
    if not size * MOST_DIVISIONS >= network.extent:
        raise ScanError(f"wanted a mesh size of at least {network.extent / MOST_DIVISIONS:.3g} m, got {size:.3g} m")
    return size


def _number(text: str) -> tuple[float, bool]:
    """A length and whether it is in % of the extent rather than in m."""
    return float(text.rstrip("%")), text.endswith("%")


def _with_surface(before: Reconstruction, parameters: SurfaceParameters, progress: Progress) -> Reconstruction:
    spanned = span_surface(before.network, parameters, progress)
    return replace(before, mesh=spanned.mesh, report={**before.report, "surface": spanned.report})


def _generator() -> str:
    return f"tracemesh {version('tracemesh')}"


def _part(progress: Progress, start: float, end: float) -> Progress:
    """The progress of a part as progress of the whole."""
    return lambda stage, fraction: progress(stage, start + (end - start) * fraction)


def _silent(stage: str, fraction: float) -> None:
    pass
