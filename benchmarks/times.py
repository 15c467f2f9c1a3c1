"""Times of the whole default pipeline at the sizes of the thesis's Table 3.9."""

from dataclasses import dataclass
from time import perf_counter

from benchmarks.apart import apart
from benchmarks.data import Data, KnownScan, noisy_scan
from benchmarks.measuring import warm_seconds
from benchmarks.table import Cell, Column, Table
from tracemesh.geometry.energy import Weights
from tracemesh.geometry.reconstruction import NetworkParameters, NetworkReconstruction, reconstruct_network
from tracemesh.geometry.scan import Scan
from tracemesh.pipeline import reconstruct
from tracemesh.wire.resources import ReconstructionParameters

COLD_BUDGET = 60.0


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
    *(
        Column(f"{part}, {state}, ms", ".1f")
        for part in ("network", "network and surface")
        for state in ("cold", "warm")
    ),
    Column("other weights, ms", ".1f"),
    Column("thesis: network, ms", ".0f"),
)

NOTES = (
    """Cold: the first call in a new process, without imports. Warm: median of 5 calls in one process. Other
    weights: the network with other smoothing lengths, the scan having been made ready before. Scans are
    noisy, all choices automatic; reading the file is not counted. Thesis: Table 3.9 (convolution, regression
    and Poisson; C++ on a quad-core computer of its day), published, not measured here.""",
)


def times(data: Data, sizes: tuple[int, ...] = tuple(THESIS), repeats: int = 5) -> Table:
    """Table of one row per size; sizes: numbers of samples of Table 3.9."""
    rows = tuple(_row(data, size, repeats) for size in sizes)
    return Table("times", "Times at the sizes of the thesis's Table 3.9", COLUMNS, rows, NOTES)


def step_for(scan: Scan, size: int) -> float:
    """Step, m, that gives a network of about so many points."""
    return sum(float(c.distance[-1] - c.distance[0]) for c in scan.curves) / size


def network_size(scan: Scan, step: float) -> int:
    """Number of points of the network that a scan becomes at a step, m."""
    return len(reconstruct_network(scan, NetworkParameters(step=step)).network.points)


def known_scan(data: Data, name: str) -> KnownScan:
    """The folder's noisy scan of this name, or a built-in one instead."""
    return data.scan(name, "noisy") if data.folder else noisy_scan({"lilium": "leaf", "cone": "cone"}[name])


def _row(data: Data, size: int, repeats: int) -> tuple[Cell, ...]:
    published = THESIS[size]
    known = known_scan(data, published.scan)
    scan = known.scan
    step = step_for(scan, size)
    network = NetworkParameters(step=step)
    whole = ReconstructionParameters(step=f"{step:.9f}")
    raw = sum(len(c.distance) for c in scan.curves)
    cells: tuple[Cell, ...] = (
        *_cold(data, published.scan, step, whole=False),
        1e3 * warm_seconds(lambda: reconstruct_network(scan, network), repeats),
        *_cold(data, published.scan, step, whole=True),
        1e3 * warm_seconds(lambda: reconstruct(scan, whole), repeats),
        1e3 * _seconds_again(scan, network, repeats),
        published.convolution + published.regression + published.poisson,
    )
    return (known.name, raw, network_size(scan, step), *cells)


def _cold(data: Data, name: str, step: float, whole: bool) -> tuple[Cell]:
    measured = apart(COLD_BUDGET, cold_seconds, data, name, step, whole)
    return (1e3 * measured.result if measured else None,)


def cold_seconds(data: Data, name: str, step: float, whole: bool) -> float:
    """Seconds of the first call in this process."""
    scan = known_scan(data, name).scan
    begin = perf_counter()
    if whole:
        reconstruct(scan, ReconstructionParameters(step=f"{step:.9f}"))
    else:
        reconstruct_network(scan, NetworkParameters(step=step))
    return perf_counter() - begin


def _seconds_again(scan: Scan, parameters: NetworkParameters, repeats: int) -> float:
    """Time to the network with other smoothing lengths, the scan having been made ready before."""
    step = parameters.step or 0.0
    reconstruction = NetworkReconstruction(scan, parameters)
    choices = iter([Weights(step, 2 * step), Weights(1.1 * step, 2.2 * step)] * (repeats + 1))
    return warm_seconds(lambda: reconstruction.solve(next(choices)), repeats)
