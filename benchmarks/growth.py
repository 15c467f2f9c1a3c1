"""How time and memory grow with the number of network samples and of mesh vertices, up to a million of each."""

from collections.abc import Callable
from time import perf_counter, process_time

from benchmarks.apart import Measured, apart
from benchmarks.data import Data, built_in
from benchmarks.measuring import fitted_exponent
from benchmarks.table import Cell, Column, Table
from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.simulated.simulation import exact_scan
from tracemesh.geometry.surfaces.surface import span_surface

SHAPE = "leaf"
SIZES = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
BUDGETS = {"network": 80.0, "surface": 420.0}
"""Seconds that each series may take."""
_LARGE = 5_000  # from here on, sizes count for the exponent

Work = Callable[[int], tuple[int, float]]
"""Does the work of a wanted size; returns the size that it had and the seconds that it took."""


def growth(data: Data, sizes: tuple[int, ...] = SIZES, budgets: dict[str, float] = BUDGETS) -> Table:
    """Table of all series; budgets: s for each of them."""
    del data  # sizes like these come from built-in shapes alone
    works: dict[str, Work] = {"network": grow_network, "surface": grow_surface}
    rows = [row for name, work in works.items() for row in _series(name, work, sizes, budgets[name])]
    columns = (
        Column("from scan to network, or from network to surface"),
        Column("samples, vertices", "d"),
        Column("time, s", ".3f"),
        Column("µs each", ".1f"),
        Column("memory, MiB", ".0f"),
        Column("KiB each", ".2f"),
    )
    note = f"""Default parameters; scan of the built-in {SHAPE}, as many raw samples as network samples. Every size in a
        new process; imports are not counted, neither in time nor in memory (most that was held at once). Exponent:
        least-squares fit over the sizes above {_LARGE}. A size is left out when it would take its series beyond
        {budgets["network"]:.0f} s (network) or {budgets["surface"]:.0f} s (surface), judged by the sizes before it."""
    return Table("growth", "Growth of time and memory with size", columns, tuple(rows), (note,))


def grow_network(size: int) -> tuple[int, float]:
    """Reconstruct a network of about so many samples."""
    shape = built_in(SHAPE)
    step = sum(curve.length for curve in shape.curves) / size
    scan = exact_scan(shape, step)
    begin = process_time()
    network = reconstruct_network(scan, NetworkParameters(step=step)).network
    return len(network.points), process_time() - begin


def grow_surface(size: int) -> tuple[int, float]:
    """Span a surface of about so many vertices over an exact network."""
    network = built_in(SHAPE).network(_mesh_size(size))
    begin = process_time()
    mesh = span_surface(network).mesh
    return len(mesh.vertices), process_time() - begin


def _mesh_size(size: int) -> float:
    """Edge length, m, with which a mesh of the shape has about so many vertices."""
    known, edge = 1000, 0.02
    return float(edge * (known / size) ** 0.5)


def _series(name: str, work: Work, sizes: tuple[int, ...], budget: float) -> list[tuple[Cell, ...]]:
    """Rows of one series, smallest first, and its exponents."""
    begin, done = perf_counter(), list[Measured[tuple[int, float]]]()
    for size in sizes:
        left = budget - (perf_counter() - begin)
        if len(done) > 1 and _expected(done, size) > left:
            break
        if (measured := apart(left, work, size)) is None:
            break
        done.append(measured)
    rows = [_row(name, measured) for measured in done]
    rows += [(name, size, f"over {budget:.0f} s", None, None, None) for size in sizes[len(done) :]]
    return [*rows, _exponents(name, done)]


def _expected(done: list[Measured[tuple[int, float]]], size: int) -> float:
    """Seconds that a size will take if the series goes on as between its last two sizes."""
    (small, _), (large, _) = (m.result for m in done[-2:])
    exponent = fitted_exponent([small, large], [m.seconds for m in done[-2:]]) or 1.0
    return float(done[-1].seconds * (size / large) ** max(exponent, 1.0))


def _row(name: str, measured: Measured[tuple[int, float]]) -> tuple[Cell, ...]:
    (size, seconds), memory = measured.result, measured.memory
    mib, each = (None, None) if memory is None else (memory / 2**20, memory / 2**10 / size)
    return (name, size, seconds, 1e6 * seconds / size, mib, each)


def _exponents(name: str, done: list[Measured[tuple[int, float]]]) -> tuple[Cell, ...]:
    large = [m for m in done if m.result[0] > _LARGE]
    sizes = [m.result[0] for m in large]
    time = fitted_exponent(sizes, [m.result[1] for m in large])
    memory = fitted_exponent(sizes, [m.memory for m in large if m.memory]) if all(m.memory for m in large) else None
    return (f"{name}: exponent", None, time, None, None if memory is None else f"{memory:.2f}", None)
