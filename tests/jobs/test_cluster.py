"""A dask cluster that loses workers, its scheduler, its server, its bucket."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.jobs.conftest import DaskCluster
from tests.jobs.support import LONG, kill, look, paused, queue, row, until, wait, wait_until_it_works
from tracemesh.errors import ClusterAway
from tracemesh.jobs.cluster import Cluster
from tracemesh.jobs.runner import JobRunner
from tracemesh.settings import Settings
from tracemesh.storage.database import Database

pytestmark = [
    pytest.mark.usefixtures("torn_connections"),
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


def test_a_scheduler_that_hangs_is_away(executor: str, dask_cluster: DaskCluster) -> None:
    cluster = Cluster(executor.replace("dask", "tcp"))
    cluster.connect()
    assert dask_cluster.scheduler is not None
    with paused([dask_cluster.scheduler.pid]):
        with pytest.raises(ClusterAway, match="does not answer"):
            cluster.connect()
        cluster.close()


SERVER = """
import sys, time
from tracemesh.jobs.runner import JobRunner
from tracemesh.settings import Settings
from tracemesh.storage.database import Database

settings = Settings.model_validate_json(sys.argv[1])
runner = JobRunner(settings, Database(settings.resolved_database_url), lambda seen: None)
time.sleep(600)
"""
"""Nothing but the part of a server that runs jobs."""


@pytest.mark.usefixtures("quick_lease")
def test_a_job_of_a_killed_server_is_done_by_the_next(
    start: Start, database: Database, settings: Settings, dask_cluster: DaskCluster
) -> None:
    """With workers alive its attempt might end by itself."""
    job = queue(database, step=LONG)
    with subprocess.Popen([sys.executable, "-c", SERVER, settings.model_dump_json()]) as server:
        wait_until_it_works(database, job)
        server.kill()
    kill(dask_cluster.pids())
    assert look(database, job).state == "running"
    start()
    assert wait(database, job).state == "done"
    assert row(database, job).attempt == 2
    assert len(look(database, job).artifacts) == 3


def test_a_bucket_that_goes_away_under_a_job_is_named_and_the_next_job_is_done(
    start: Start, database: Database, s3: Any, tmp_path: Path
) -> None:
    cluster = DaskCluster(tmp_path)  # of its own: the bucket's keys are in its workers' environment
    try:
        cluster.start()
        start(executor=f"dask://{cluster.address}", artifact_bucket=s3.bucket)
        job = queue(database, step=LONG)
        wait_until_it_works(database, job)
        s3.stop()
        failed = wait(database, job)
        assert failed.state == "failed"
        assert s3.bucket in str(failed.error)
        s3.start()
        assert wait(database, queue(database)).state == "done"
    finally:
        cluster.stop()
