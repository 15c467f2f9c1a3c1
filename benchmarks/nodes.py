"""Nodes inferred from scans whose marks were taken away."""

from collections.abc import Sequence
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
SURE = 0.9
"""Confidence above which a person would not look again."""

NOTE = f"""All marks are taken from a noisy scan; what is proposed is compared with them. Counted are meetings of two
    curves. One is found when a proposal is within {1e3 * TOLERANCE:.0f} mm of it along both curves; its error is that
    on the worse curve, the operator's own of about 1 mm included. Precision: found ones among those proposed; recall:
    among the true ones. Wanted: both at least .95, median error at most 8 mm. Mean confidence: of the proposals;
    honest is what equals the precision. Sure: share of the proposals with a confidence above {SURE}, and the precision
    of these alone."""


@dataclass(frozen=True)
class Meeting:
    """Two curves (by index, first the smaller) that meet, and where (m) on each."""

    curves: tuple[int, int]
    places: tuple[float, float]
    confidence: float = 1.0


@dataclass(frozen=True)
class Result:
    """true: number of meetings. confidences: of the proposed ones. right: which (p,) of them are true.

    errors: m, of the true ones that were found.
    """

    true: int
    confidences: list[float]
    right: list[bool]
    errors: list[float]
    seconds: float


def nodes(data: Data, names: tuple[str, ...] = tuple(SHAPES), seeds: int = 10) -> Table:
    """Table of precision, recall and error; names: of built-in shapes, each scanned `seeds` times."""
    results = {
        f"{name} (built in), {seeds} scans": _together([_inferred(noisy_scan(name, seed)) for seed in range(seeds)])
        for name in names
    }
    results |= {known.name: _inferred(known) for known in data.scans("noisy")}
    results["all"] = _together(list(results.values()))
    rows = tuple(_row(name, result) for name, result in results.items())
    columns = (
        Column("noisy scan without marks"),
        *(Column(name, "d") for name in ("true", "proposed", "found")),
        Column("precision", ".3f"),
        Column("recall", ".3f"),
        Column("mean confidence", ".3f"),
        Column("sure", ".2f"),
        Column("precision of the sure", ".3f"),
        Column("median error, mm", ".1f"),
        Column("largest, mm", ".1f"),
        Column("s", ".1f"),
    )
    return Table("nodes", "Nodes without marks", columns, rows, (NOTE,))


def without_marks(scan: Scan) -> Scan:
    """The same curves, nothing marked on them."""
    nothing = np.empty(0, np.int64)
    return Scan(tuple(replace(curve, node_samples=nothing, node_ids=nothing) for curve in scan.curves))


def meetings(node: dict[int, float], confidence: float = 1.0) -> list[Meeting]:
    """Every two curves at a node; node: place (m) on every curve through it."""
    return [Meeting((i, j), (node[i], node[j]), confidence) for i, j in combinations(sorted(node), 2)]


def marked_meetings(scan: Scan) -> list[Meeting]:
    """Meetings that were marked."""
    found: dict[int, dict[int, float]] = {}
    for index, curve in enumerate(scan.curves):
        for sample, node in zip(curve.node_samples, curve.node_ids, strict=True):
            found.setdefault(int(node), {})[index] = float(curve.distance[sample])
    return [m for node in found.values() for m in meetings(node)]


def proposed_meetings(scan: Scan, inferred: InferredNodes) -> list[Meeting]:
    """Meetings that were proposed."""
    return [
        m
        for p in inferred.proposals
        for m in meetings({i: float(scan.curves[i].distance[k]) for i, k in p.places}, p.confidence)
    ]


def matches(scan: Scan, true: list[Meeting], proposed: list[Meeting]) -> dict[Meeting, float]:
    """The proposals that are true, and their errors, m; none counts twice."""
    found: dict[Meeting, float] = {}
    for meeting in true:
        rivals = [(_error(scan, meeting, p), p) for p in proposed if p not in found]
        error, chosen = min(rivals, key=lambda rival: rival[0], default=(float("inf"), meeting))
        if error <= TOLERANCE:
            found[chosen] = error
    return found


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
    found = matches(known.scan, true, proposed)
    right = [p in found for p in proposed]
    return Result(len(true), [p.confidence for p in proposed], right, list(found.values()), seconds)


def _together(results: list[Result]) -> Result:
    confidences, right, errors = (
        [x for r in results for x in getattr(r, n)] for n in ("confidences", "right", "errors")
    )
    return Result(sum(r.true for r in results), confidences, right, errors, sum(r.seconds for r in results))


def _row(name: str, result: Result) -> tuple[Cell, ...]:
    found, millimetres = len(result.errors), [1e3 * e for e in result.errors]
    middle, largest = (float(np.median(millimetres)), max(millimetres)) if found else (None, None)
    counts = (result.true, len(result.right), found)
    sure = [right for right, c in zip(result.right, result.confidences, strict=True) if c > SURE]
    honesty = (_mean(result.confidences), len(sure) / max(1, len(result.right)), _mean(sure))
    return (name, *counts, _mean(result.right), found / result.true, *honesty, middle, largest, result.seconds)


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None
