"""`python -m benchmarks [TABLE ...]`: measure, print, and keep in docs/benchmarks.md and docs/benchmarks.json."""

import argparse
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from time import perf_counter

from benchmarks import (
    accuracy,
    arrays,
    browsing,
    crossings,
    growth,
    ingest,
    lengths,
    meshes,
    nodes,
    noisy,
    regression,
    service,
    surfacing,
    times,
)
from benchmarks.data import ROOT, Data
from benchmarks.machine import machine, revision
from benchmarks.measuring import yardstick
from benchmarks.report import elsewhere, read_report, record, write_report
from benchmarks.table import Table

TABLES: dict[str, Callable[[Data], Table]] = {
    "surfacing": surfacing.surfacing,
    "meshes": meshes.meshes,
    "noisy": noisy.noisy,
    "uncertainty": noisy.uncertainty,
    "nodes": nodes.nodes,
    "crossings": crossings.crossings,
    "author": accuracy.author,
    "steps": accuracy.steps,
    "weights": accuracy.weights,
    "surfaces": accuracy.surfaces,
    "lengths": lengths.lengths,
    "times": times.times,
    "regression": regression.regression,
    "arrays": arrays.arrays,
    "growth": growth.growth,
    "ingest": ingest.ingest,
    "browsing": browsing.browsing,
    "starts": service.starts,
    "requests": service.requests,
    "jobs": service.jobs,
    "costs": service.costs,
}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "tables", nargs="*", metavar="TABLE", help=f"one of {', '.join(TABLES)}; all when none is named"
    )
    parser.add_argument("--anew", action="store_true", help="drop the tables of another machine that are not named")
    wanted = parser.parse_args(arguments)
    chosen = wanted.tables or list(TABLES)
    if unknown := sorted(set(chosen) - set(TABLES)):
        parser.error(f"no table {', '.join(unknown)}: there are {', '.join(TABLES)}")
    data, folder = Data.beside_checkout(), ROOT / "docs"
    if wanted.tables and not wanted.anew and (differs := elsewhere(folder / "benchmarks.json", machine())):
        parser.error(f"docs/benchmarks.json is of another machine ({differs}): name no table, or --anew drops the rest")
    report = read_report(folder / "benchmarks.json", machine())
    for name in chosen:
        standard, now = yardstick(), datetime.now(UTC).date().isoformat()
        begin = perf_counter()
        table = TABLES[name](data)
        print(table.markdown(), flush=True)
        report["tables"][name] = record(table, now, revision(ROOT), perf_counter() - begin, standard)
        write_report(folder, report, list(TABLES))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
