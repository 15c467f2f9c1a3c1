"""Nodes inferred from scans whose marks were taken away."""

from dataclasses import dataclass, replace
from itertools import combinations
from time import process_time

import numpy as np

from benchmarks.data import Data, KnownScan, noisy_scan
from benchmarks.table import Cell, Column, Table
from tracemesh.geometry.nodes.node_inference import InferredNodes, infer_nodes
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shapes import SHAPES

TOLERANCE = 0.02
"""m along both curves within which a proposal is the true node."""

NOTE = f"""All marks are taken from a noisy scan; what is proposed is compared with them. Counted are meetings of two
    curves. One is found when a proposal is within {1e3 * TOLERANCE:.0f} mm of it along both curves; its error is that
    on the worse curve, the operator's own of about 1 mm included. Precision: found ones among those proposed; recall:
    among the true ones. Wanted: both at least .95, median error at most 8 mm."""


@dataclass(frozen=True)
class Meeting:
    """Two curves (by index, first the smaller) that meet, and where (m) on each."""

    curves: tuple[int, int]
    places: tuple[float, float]


@dataclass(frozen=True)
class Result:
    """true, proposed: number of meetings. errors: m, of the true ones that were found."""

    name: str
    true: int
    proposed: int
    errors: list[float]
    seconds: float


def nodes(data: Data, names: tuple[str, ...] = tuple(SHAPES)) -> Table:
    """Table of precision, recall and error; names: of built-in shapes."""
    results = [_inferred(known) for known in (*map(noisy_scan, names), *data.scans("noisy"))]
    together = Result(
        "all",
        sum(r.true for r in results),
        sum(r.proposed for r in results),
        [e for r in results for e in r.errors],
        sum(r.seconds for r in results),
    )
    rows = tuple(_row(result) for result in (*results, together))
    columns = (
        Column("noisy scan without marks"),
        *(Column(name, "d") for name in ("true", "proposed", "found")),
        Column("precision", ".3f"),
        Column("recall", ".3f"),
        Column("median error, mm", ".1f"),
        Column("largest, mm", ".1f"),
        Column("s", ".1f"),
    )
    return Table("nodes", "Nodes without marks", columns, rows, (NOTE,))


def without_marks(scan: Scan) -> Scan:
    """The same curves, nothing marked on them."""
    nothing = np.empty(0, np.int64)
    return Scan(tuple(replace(curve, node_samples=nothing, node_ids=nothing) for curve in scan.curves))


def meetings(nodes_of_curves: list[dict[int, float]]) -> list[Meeting]:
    """Every two curves at each node; a node: place (m) on every curve through it."""
    return [Meeting((i, j), (node[i], node[j])) for node in nodes_of_curves for i, j in combinations(sorted(node), 2)]


def marked_meetings(scan: Scan) -> list[Meeting]:
    """Meetings that were marked."""
    found: dict[int, dict[int, float]] = {}
    for index, curve in enumerate(scan.curves):
        for sample, node in zip(curve.node_samples, curve.node_ids, strict=True):
            found.setdefault(int(node), {})[index] = float(curve.distance[sample])
    return meetings(list(found.values()))


def proposed_meetings(scan: Scan, inferred: InferredNodes) -> list[Meeting]:
    """Meetings that were proposed."""
    return meetings([{i: float(scan.curves[i].distance[k]) for i, k in p.places} for p in inferred.proposals])


def match_errors(scan: Scan, true: list[Meeting], proposed: list[Meeting]) -> list[float]:
    """Errors, m, of the true meetings that a proposal is near to; no proposal counts twice."""
    free, errors = list(proposed), []
    for meeting in true:
        rivals = [(error, p) for p in free if (error := _error(scan, meeting, p)) <= TOLERANCE]
        if rivals:
            error, chosen = min(rivals, key=lambda rival: rival[0])
            free.remove(chosen)
            errors.append(error)
    return errors


def _error(scan: Scan, true: Meeting, proposed: Meeting) -> float:
    if true.curves != proposed.curves:
        return float("inf")
    places = zip(true.curves, true.places, proposed.places, strict=True)
    return max(_way(scan.curves[curve], a, b) for curve, a, b in places)


def _way(curve: CurveScan, a: float, b: float) -> float:
    """Distance (m) along a curve, the shorter way round if it is closed."""
    length = float(np.ptp(curve.distance))
    return abs((a - b + length / 2) % length - length / 2) if curve.closed else abs(a - b)


def _inferred(known: KnownScan) -> Result:
    bare = without_marks(known.scan)
    begin = process_time()
    inferred = infer_nodes(bare)
    seconds = process_time() - begin
    true, proposed = marked_meetings(known.scan), proposed_meetings(known.scan, inferred)
    return Result(known.name, len(true), len(proposed), match_errors(known.scan, true, proposed), seconds)


def _row(result: Result) -> tuple[Cell, ...]:
    found, millimetres = len(result.errors), [1e3 * e for e in result.errors]
    middle, largest = (float(np.median(millimetres)), max(millimetres)) if found else (None, None)
    precision = found / result.proposed if result.proposed else None
    counts = (result.true, result.proposed, found)
    return (result.name, *counts, precision, found / result.true, middle, largest, result.seconds)
