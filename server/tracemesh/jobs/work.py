"""One attempt at a reconstruction, in whatever process it runs: reads its scan, writes its progress and its results.

The kernel is imported where it runs: the server itself stays small and starts at once.
"""

from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING

from tracemesh.errors import Cancelled, TracemeshError, Unavailable
from tracemesh.formats.networks import read_network
from tracemesh.jobs.numbering import numbered
from tracemesh.storage.artifacts import ArtifactStore, artifact_row
from tracemesh.storage.database import Database
from tracemesh.storage.readings import StoredReading, is_of_array, load_reading
from tracemesh.storage.reconstructions import Claim, begin, finish, get_reconstruction, report_progress
from tracemesh.storage.scans import load_scan
from tracemesh.wire.resources import JobState, Reconstruction

if TYPE_CHECKING:
    from tracemesh.pipeline import Reconstruction as Result


NETWORK = "network.json"


def load_kernel() -> None:
    """Take the time that it takes to import the kernel."""
    import tracemesh.pipeline  # noqa: F401 - work finds it loaded


def work(database_url: str, store: ArtifactStore, claim: Claim) -> None:
    """Run an attempt to its end, whatever that is; the row tells.

    Raises BrokenExecutor when another process began with the same attempt: a cluster tries again by itself, without
    counting.
    """
    database = Database(database_url)
    try:
        _Attempt(database, store, claim).run()
    finally:
        database.close()


class _Attempt:
    def __init__(self, database: Database, store: ArtifactStore, claim: Claim) -> None:
        self._database = database
        self._store = store
        self._claim = claim

    def run(self) -> None:
        try:
            self._reconstruct()
        except Cancelled:
            self._end("cancelled")
        except TracemeshError as error:
            self._end("failed", str(error))
        except MemoryError:
            self._end("failed", "it needs more memory than there is")

    def _reconstruct(self) -> None:
        with self._database.write() as transaction:
            if not begin(transaction, self._claim):
                raise BrokenExecutor(f"attempt {self._claim.attempt} at {self._claim.id} began before, or ended")
        with self._database.read() as transaction:
            wanted = get_reconstruction(transaction, self._claim.id)
        result = self._span(wanted) if NETWORK in wanted.artifacts else self._from_scan(wanted)
        files = {name: content for name, content in _files(result).items() if name not in wanted.artifacts}
        artifacts = self._stored(files)
        with self._database.write() as transaction:
            finish(transaction, self._claim, "done", artifacts=artifacts)

    def _stored(self, files: dict[str, bytes]) -> dict[str, tuple[str, int]]:
        try:
            return {name: (self._store.put(content), len(content)) for name, content in files.items()}
        except OSError as error:
            raise Unavailable(f"its files could not be stored: {error.strerror}; try again") from None

    def _from_scan(self, wanted: Reconstruction) -> "Result":
        from tracemesh.pipeline import reconstruct

        session, number = wanted.session, wanted.parameters.reading
        with self._database.read() as transaction:
            of_array = is_of_array(transaction, session, number)
            stored = load_reading(transaction, session, number) if of_array else load_scan(transaction, session)
        if isinstance(stored, StoredReading):
            return self._from_reading(wanted, stored)
        scan, indices = stored
        with numbered(indices):
            return reconstruct(scan, wanted.parameters, self._progress)

    def _from_reading(self, wanted: Reconstruction, stored: StoredReading) -> "Result":
        from tracemesh.formats.readings import sensor_array, sensor_rotations
        from tracemesh.pipeline import reconstruct_reading

        rotations = sensor_rotations(stored.reading, stored.device)
        return reconstruct_reading(sensor_array(stored.device), rotations, wanted.parameters, self._progress)

    def _span(self, wanted: Reconstruction) -> "Result":
        """The surface over the network that came with the wish."""
        from tracemesh.pipeline import span

        with self._database.read() as transaction:
            digest = artifact_row(transaction, wanted.id, NETWORK).sha256
        return span(read_network(self._store.path(digest).read_text("utf-8"), NETWORK), self._progress)

    def _progress(self, stage: str, fraction: float) -> None:
        with self._database.write() as transaction:
            if not report_progress(transaction, self._claim, stage, fraction):
                raise Cancelled(f"reconstruction {self._claim.id} was asked to stop")

    def _end(self, state: JobState, error: str | None = None) -> None:
        with self._database.write() as transaction:
            finish(transaction, self._claim, state, error)


def _files(result: "Result") -> dict[str, bytes]:
    files = {NETWORK: result.network_file(), "report.json": result.report_file()}
    return files if result.mesh is None else {**files, "mesh.glb": result.mesh_file()}
