"""A dask cluster that loses workers, its scheduler, its server."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.jobs.conftest import DaskCluster
from tests.jobs.support import LONG, kill, look, queue, row, until, wait, wait_until_it_works
from tracemesh.jobs.runner import JobRunner
from tracemesh.storage.database import Database

pytestmark = [
    pytest.mark.parametrize("database_url", ["sqlite"], indirect=True),
    pytest.mark.parametrize("executor", ["dask"], indirect=True),
]
Start = Callable[..., JobRunner]


def test_a_killed_worker_costs_an_attempt_not_the_job(start: Start, database: Database, dask_cluster: Any) -> None:
    """Dask itself would run it again on the other worker, with the same attempt: that one is refused."""
    job = queue(database, step=LONG)
    start()
    wait_until_it_works(database, job)
    kill(dask_cluster.pids())
    assert wait(database, job).state == "done"
    assert (row(database, job).attempt, row(database, job).losses) == (2, 1)
    dask_cluster.wait_for_workers()


def test_jobs_wait_for_a_scheduler_that_is_away(start: Start, database: Database, tmp_path: Path) -> None:
    cluster = DaskCluster(tmp_path)
    job = queue(database, step=LONG)
    start(executor=f"dask://{cluster.address}")
    try:
        cluster.start()
        wait_until_it_works(database, job)
        cluster.stop()
        until(lambda: look(database, job).state == "queued")
        cluster.start()
        assert wait(database, job).state == "done"
        assert row(database, job).losses == 0
    finally:
        cluster.stop()
