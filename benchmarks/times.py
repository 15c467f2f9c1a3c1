"""Times of the whole default pipeline at the sizes of the thesis's Table 3.9."""

from dataclasses import dataclass
from time import process_time

from benchmarks.apart import apart
from benchmarks.data import Data, KnownScan, noisy_scan
from benchmarks.measuring import warm_seconds
from benchmarks.table import Cell, Column, Table
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.reconstruction import NetworkParameters, NetworkReconstruction, reconstruct_network
from tracemesh.geometry.scan import Scan
from tracemesh.pipeline import reconstruct
from tracemesh.wire.resources import ReconstructionParameters

COLD_BUDGET = 20.0
"""Seconds, imports included, after which a cold call is given up."""


@dataclass(frozen=True)
class ThesisTimes:
    """A row of Table 3.9, ms on a quad-core computer, C++: convolution, regression (ROPTLIB), Poisson."""

    scan: str
    convolution: float
    regression: float
    poisson: float


THESIS = {
    96: ThesisTimes("lilium", 3, 51, 1),
    382: ThesisTimes("lilium", 6, 234, 7),
    1416: ThesisTimes("lilium", 15, 788, 170),
    3094: ThesisTimes("cone", 22, 2779, 904),
}

COLUMNS = (
    Column("scan"),
    Column("raw samples", "d"),
    Column("samples", "d"),
    *(Column(f"network, {state}, ms", ".1f") for state in ("cold", "warm", "other weights")),
    Column("thesis: network, ms", ".0f"),
    *(Column(f"network and surface, {state}, ms", ".0f") for state in ("cold", "warm")),
    Column("vertices", "d"),
)

NOTES = (
    f"""Scans are noisy, all choices automatic; reading the file is not counted. Cold: the first call in a new process,
    without imports. Warm: the fastest of up to 7 calls in one process. Other weights: other smoothing lengths, the scan
    having been made ready before. Surface: meshed as finely as the network; without figure where that took more than
    {COLD_BUDGET:.0f} s. Thesis: Table 3.9 (convolution, regression and Poisson; C++ on a quad-core computer of its
    day), published, not measured here.""",
)


def times(data: Data, sizes: tuple[int, ...] = tuple(THESIS), repeats: int = 7) -> Table:
    """Table of one row per size; sizes: numbers of samples of Table 3.9."""
    rows = tuple(_row(data, size, repeats) for size in sizes)
    return Table("times", "Times at the sizes of the thesis's Table 3.9", COLUMNS, rows, NOTES)


def step_for(scan: Scan, size: int) -> float:
    """Step, m, that gives a network of about so many points."""
    return sum(float(c.distance[-1] - c.distance[0]) for c in scan.curves) / size


def known_scan(data: Data, name: str) -> KnownScan:
    """The folder's noisy scan of this name, or a built-in one instead."""
    return data.scan(name, "noisy") if data.folder else noisy_scan({"lilium": "leaf", "cone": "cone"}[name])


def _row(data: Data, size: int, repeats: int) -> tuple[Cell, ...]:
    published = THESIS[size]
    known = known_scan(data, published.scan)
    scan, step = known.scan, step_for(known.scan, size)
    parameters = NetworkParameters(step=step)
    cold = apart(COLD_BUDGET, cold_network, data, published.scan, step)
    return (
        known.name,
        sum(len(c.distance) for c in scan.curves),
        len(reconstruct_network(scan, parameters).network.points),
        1e3 * cold.result if cold else None,
        1e3 * warm_seconds(lambda: reconstruct_network(scan, parameters), repeats),
        1e3 * _seconds_again(scan, parameters, repeats),
        published.convolution + published.regression + published.poisson,
        *_whole(data, published.scan, step, repeats),
    )


def _whole(data: Data, name: str, step: float, repeats: int) -> tuple[Cell, ...]:
    cold = apart(COLD_BUDGET, cold_whole, data, name, step)
    if cold is None:
        return (None, None, None)
    scan = known_scan(data, name).scan
    seconds, vertices = cold.result
    return (1e3 * seconds, 1e3 * warm_seconds(lambda: reconstruct(scan, _parameters(step)), repeats), vertices)


def cold_network(data: Data, name: str, step: float) -> float:
    """Seconds of the first call in this process."""
    scan = known_scan(data, name).scan
    begin = process_time()
    reconstruct_network(scan, NetworkParameters(step=step))
    return process_time() - begin


def cold_whole(data: Data, name: str, step: float) -> tuple[float, int]:
    """Seconds of the first call in this process, surface included, and the number of vertices."""
    scan = known_scan(data, name).scan
    begin = process_time()
    mesh = reconstruct(scan, _parameters(step)).mesh
    assert mesh is not None
    return process_time() - begin, len(mesh.vertices)


def _parameters(step: float) -> ReconstructionParameters:
    return ReconstructionParameters(step=f"{step:.9f}")


def _seconds_again(scan: Scan, parameters: NetworkParameters, repeats: int) -> float:
    """Time to the network with other smoothing lengths, the scan having been made ready before."""
    step = parameters.step or 0.0
    reconstruction = NetworkReconstruction(scan, parameters)
    choices = iter([Weights(step, 2 * step), Weights(1.1 * step, 2.2 * step)] * (repeats + 1))
    return warm_seconds(lambda: reconstruction.solve(next(choices)), repeats)
