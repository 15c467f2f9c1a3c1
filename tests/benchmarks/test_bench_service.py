"""The benchmarks of the service ask a real server."""

from typing import Any

from benchmarks.data import Data
from benchmarks.service import costs, jobs, requests, starts
from benchmarks.table import Table


def row(table: Table, number: int) -> dict[str, Any]:
    return dict(zip((c.title for c in table.columns), table.rows[number], strict=True))


def test_every_kind_of_request_is_timed() -> None:
    table = requests(Data(None), count=8, sessions=3)
    assert [r[0] for r in table.rows][0::2] == ["list of 3 sessions", "preview"]
    assert all(0 < float(r[2] or 0) <= float(r[3] or 0) for r in table.rows)


def test_jobs_run_on_both_executors_while_somebody_previews() -> None:
    table = jobs(Data(None), count=2, step="6%")
    assert [r[0] for r in table.rows] == ["embedded", "dask"]
    for number in (0, 1):
        assert 0 < row(table, number)["preview p50 meanwhile, ms"] <= row(table, number)["preview p95 meanwhile, ms"]
        assert row(table, number)["memory of its process, MB"] > 20


def test_what_a_session_costs() -> None:
    table = costs(Data(None), sessions=2, step="6%")
    assert len(table.rows) == 3
    assert row(table, 0)["kB on disk"] > 10
    assert row(table, 1)["processor time, s"] > 0


def test_starts_of_servers_and_workers() -> None:
    """A server that knows its folder is the same server; a further worker is a copy that owns little."""
    table = starts(Data(None), count=1)
    new, known, first, further = table.rows
    assert all(float(row[2] or 0) > 0 and float(row[3] or 0) > 20 for row in (new, known))
    assert float(first[1] or 0) > 0 < float(further[1] or 0)
    assert 0 < float(further[3] or 0) < float(new[3] or 0)
