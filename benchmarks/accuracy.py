"""Error of networks and surfaces against step and weights, as in the thesis's figures 3.15-3.22 and 5.17-5.21."""

from dataclasses import dataclass

from benchmarks.data import Data, KnownScan, built_in, exact_network, noisy_scan
from benchmarks.measuring import Motion, closest_motion, fitted_exponent
from benchmarks.regression import thesis_weights
from benchmarks.surfacing import surface_error
from benchmarks.table import Cell, Column, Table
from benchmarks.truths import CurveTruth, MeshTruth
from tracemesh.errors import TracemeshError
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan
from tracemesh.geometry.surfaces.surface import span_surface

STEPS = (6.4, 3.2, 1.6, 0.8, 0.4)
RAW_STEP = 1e-3  # of the diagonal, between the samples of a built-in shape's exact scan
_ABOVE = 3.0  # times the error at the finest step, where samples and truth end: only such steps tell an order
SCHEMES: dict[str, tuple[float, float] | None] = {
    "automatic": None,
    "1, 1": (1, 1),
    "1, 100": (1, 100),
    "100, 1": (100, 1),
    "100, 100": (100, 100),
}


@dataclass(frozen=True)
class Error:
    """mean, largest: distance of a network's points to the true curves, % of the diagonal, after the rigid motion."""

    mean: float
    largest: float
    motion: Motion


def network_error(network: CurveNetwork, truth: CurveTruth | MeshTruth, diagonal: float) -> Error:
    """Error of a reconstructed network."""
    motion = closest_motion(network.points, truth.closest)
    distance = truth.distance(motion.apply(network.points)) * (100 / diagonal)
    return Error(float(distance.mean()), float(distance.max()), motion)


def steps(data: Data, names: tuple[str, ...] = tuple(SHAPES), percent: tuple[float, ...] = STEPS) -> Table:
    """Table of errors from exact scans against the step, % of the diagonal; names: of built-in shapes."""
    rows = [_steps_row(_exact(name), percent) for name in names]
    rows += [_steps_row(known, percent) for known in data.scans("exact")]
    columns = (
        Column("exact scan"),
        *(Column(f"h = {p} %", ".5f") for p in percent),
        Column("order", ".2f"),
        Column(f"largest at {percent[-1]} %", ".5f"),
    )
    note = """Mean distance of the network's points to the true curves, % of the diagonal, all choices automatic
        (figures 3.15-3.17). Order: exponent of the least-squares fit error ~ h^order over the steps whose error is more
        than 3 times that at the finest, where the samples and the polylines of the truth are the limit."""
    return Table("steps", "Networks from exact scans, against the step", columns, tuple(rows), (note,))


def author(data: Data, percent: tuple[float, ...] = STEPS) -> Table:
    """Table of errors of the thesis author's own lilium against its mesh."""
    rows: list[tuple[Cell, ...]] = []
    if data.folder:
        scan = read_rawnet((data.folder / "lilium.rawnet").read_text(), "lilium.rawnet")
        truth = MeshTruth.read(data.folder / "lilium.obj")
        for p in percent:
            network = reconstruct_network(scan, NetworkParameters(step=p / 100 * truth.diagonal)).network
            error = network_error(network, truth, truth.diagonal)
            rows.append((f"{p} %", len(network.points), error.mean, error.largest))
    columns = (Column("h"), Column("points", "d"), Column("mean, %", ".5f"), Column("largest, %", ".5f"))
    note = "lilium.rawnet by the author of the thesis against lilium.obj, rigid registration without scale."
    return Table("author", "The author's own lilium", columns, tuple(rows), (note,))


def weights(data: Data, names: tuple[str, ...] = ("leaf", "cone"), percent: tuple[float, ...] = STEPS) -> Table:
    """Table of errors from noisy scans against step and weights; names: of built-in shapes."""
    scans = [*map(noisy_scan, names), *data.scans("noisy")]
    rows = tuple(_weights_row(known, scheme, percent) for known in scans for scheme in SCHEMES)
    columns = (Column("noisy scan"), Column("lambda, mu"), *(Column(f"h = {p} %", ".3f") for p in percent))
    note = """Mean distance of the network's points to the true curves, % of the diagonal (figures 3.18-3.22).
        Weights are the thesis's, counted per sample as it does: lambda = (stretch / h)^2, mu = (bend / h)^4;
        heading and scale per curve are chosen automatically in all rows. The thesis reports, from its own scans
        of real objects: cone about .4 %, lilium 1.1 to 1.5 %."""
    return Table("weights", "Networks from noisy scans, against step and weights", columns, rows, (note,))


def surfaces(
    data: Data, names: tuple[str, ...] = ("leaf", "cone", "torus"), percent: tuple[float, ...] = STEPS[:4]
) -> Table:
    """Table of surface errors from noisy scans of built-in shapes against step and weights."""
    del data  # the folder's scans come with true curves only
    rows = tuple(_surfaces_row(name, scheme, percent) for name in names for scheme in SCHEMES)
    columns = (Column("noisy scan"), Column("lambda, mu"), *(Column(f"h = {p} %", ".3f") for p in percent))
    note = """Mean distance of the surface to the true one, weighted by area, % of the diagonal, after the
        registration of the network (figures 5.17-5.21). The thesis reports from its own scans of real objects,
        at its finest step: always below 1 %, lilium with a smartphone .62 %, with the Morphorider about .85 to
        1 %."""
    return Table("surfaces", "Surfaces from noisy scans, against step and weights", columns, rows, (note,))


def _exact(name: str) -> KnownScan:
    shape = built_in(name)
    truth = exact_network(shape)
    return KnownScan(f"{name} (built in)", exact_scan(shape, RAW_STEP * truth.diagonal), truth)


def _steps_row(known: KnownScan, percent: tuple[float, ...]) -> tuple[Cell, ...]:
    truth = CurveTruth.of(known.truth)
    errors = []
    for p in percent:
        network = reconstruct_network(known.scan, NetworkParameters(step=p / 100 * known.diagonal)).network
        errors.append(network_error(network, truth, known.diagonal))
    means = [e.mean for e in errors]
    above = [(p, mean) for p, mean in zip(percent, means, strict=True) if mean > _ABOVE * means[-1]]
    return (known.name, *means, fitted_exponent(*zip(*above, strict=True)) if above else None, errors[-1].largest)


def _weights_row(known: KnownScan, scheme: str, percent: tuple[float, ...]) -> tuple[Cell, ...]:
    truth = CurveTruth.of(known.truth)
    cells: list[Cell] = []
    for p in percent:
        network = reconstruct_network(known.scan, _parameters(scheme, p / 100 * known.diagonal)).network
        cells.append(network_error(network, truth, known.diagonal).mean)
    return (known.name, scheme, *cells)


def _surfaces_row(name: str, scheme: str, percent: tuple[float, ...]) -> tuple[Cell, ...]:
    known, surface = noisy_scan(name), MeshTruth(*built_in(name).mesh(96))
    return (known.name, scheme, *(_surface_error(known, surface, scheme, p) for p in percent))


def _surface_error(known: KnownScan, surface: MeshTruth, scheme: str, percent: float) -> Cell:
    network = reconstruct_network(known.scan, _parameters(scheme, percent / 100 * known.diagonal)).network
    motion = network_error(network, CurveTruth.of(known.truth), known.diagonal).motion
    try:
        mesh = span_surface(network).mesh
    except TracemeshError:
        return "no surface"
    return surface_error(motion.apply(mesh.vertices), mesh.faces, surface)


def _parameters(scheme: str, step: float) -> NetworkParameters:
    chosen = SCHEMES[scheme]
    if chosen is None:
        return NetworkParameters(step=step)
    lengths = thesis_weights(*chosen, step)
    return NetworkParameters(step=step, stretch=lengths.stretch, bend=lengths.bend)
