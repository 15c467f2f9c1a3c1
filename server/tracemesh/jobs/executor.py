"""Where jobs run: worker processes of this server, or those of a dask cluster; the same work either way."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol, TypeVar

from tracemesh.jobs.slot import Slot
from tracemesh.settings import Settings

T = TypeVar("T")
NICENESS = 10
"""Jobs leave the processor to what somebody waits for: recording, the live view, previews."""


class Worker(Protocol):
    """Runs one function after another in some other process; from any thread."""

    def connect(self) -> None:
        """Make sure that there is somebody to run functions; raises ClusterAway."""

    def submit(self, function: Callable[..., T], *arguments: object) -> Future[T]:
        """Run there; raises ClusterAway, or BrokenExecutor when the process was lost; so does the future."""

    def prepare(self, function: Callable[..., object]) -> None:
        """Run something beforehand, where that makes the next function start sooner."""

    def renew(self) -> None:
        """Give up what was submitted, so that something else can be."""

    def close(self) -> None:
        """Give up what was submitted, for good."""


def make_workers(settings: Settings) -> list[Worker]:
    """As many as jobs may run at once."""
    if settings.cluster_address is None:
        return [Slot(NICENESS, settings.job_memory) for _ in range(settings.job_slots)]
    from tracemesh.jobs.cluster import Cluster  # only who has a cluster has dask

    cluster = Cluster(settings.cluster_address)
    return [cluster] * settings.job_slots
