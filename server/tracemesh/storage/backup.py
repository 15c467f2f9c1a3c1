"""Everything of a server in one folder while it runs: a snapshot of the database, and every artifact that it names."""

import os
import shutil
import sqlite3
import subprocess
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.engine import URL, make_url

from tracemesh.errors import NotFound, ResourceError
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import ArtifactStore, open_artifacts
from tracemesh.storage.database import Database, database_faults_in_words
from tracemesh.storage.models import ArtifactRow

DUMP = "tracemesh.pgdump"
"""Name of a PostgreSQL database's snapshot, as pg_restore reads it."""


@dataclass(frozen=True)
class Backup:
    """What a folder holds after a backup: `lost` are digests of artifacts that the store lacks or has damaged."""

    database: Path
    artifacts: int
    lost: list[str]


def back_up(settings: Settings, folder: Path, progress: Callable[[str, float], None]) -> Backup:
    """Bring `folder` up to date; artifacts that it has from before are not copied again.

    Of SQLite the folder is a data folder that can be served as it is. Raises ResourceError.
    """
    url = make_url(settings.resolved_database_url)
    if url.get_backend_name() == "sqlite" and not Path(str(url.database)).is_file():
        raise ResourceError(f"there is no server's database {url.database}")
    if folder.resolve() == settings.data_dir.resolve():
        raise ResourceError(f"wanted another folder than the data folder {settings.data_dir}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResourceError(f"the folder {folder} cannot be made: {error.strerror}") from None
    kept = ArtifactStore(folder / settings.artifact_dir.name)
    progress("database", 0.0)
    with database_faults_in_words(), closing(Database(settings.resolved_database_url)) as database:
        named = _named(database)
        snapshot = _snapshot(url, folder)
        named |= _named(database)  # the snapshot was made between the two
    return Backup(snapshot, len(named), _copy(open_artifacts(settings), kept, sorted(named), progress))


def _named(database: Database) -> set[str]:
    with database.read() as transaction:
        return set(transaction.scalars(select(ArtifactRow.sha256).distinct()))


def _copy(
    store: ArtifactStore, kept: ArtifactStore, digests: list[str], progress: Callable[[str, float], None]
) -> list[str]:
    lost = []
    for done, digest in enumerate(digests):
        progress("artifacts", done / len(digests))
        try:
            if not kept.has(digest) and kept.put(store.path(digest).read_bytes()) != digest:
                lost.append(digest)
        except NotFound:
            lost.append(digest)
    return lost


def _snapshot(url: URL, folder: Path) -> Path:
    """Written beside the snapshot of before, which it replaces when it is whole."""
    sqlite = url.get_backend_name() == "sqlite"
    target = folder / (Path(str(url.database)).name if sqlite else DUMP)
    fresh = target.with_suffix(".new")
    fresh.unlink(missing_ok=True)
    (_copy_sqlite if sqlite else _dump_postgresql)(url, fresh)
    fresh.replace(target)
    return target


def _copy_sqlite(url: URL, target: Path) -> None:
    """In one read transaction, which keeps no writer waiting."""
    with closing(sqlite3.connect(str(url.database))) as source, closing(sqlite3.connect(target)) as copy:
        source.backup(copy)


def _dump_postgresql(url: URL, target: Path) -> None:
    program = shutil.which("pg_dump")
    if program is None:
        raise ResourceError("wanted pg_dump, which copies a PostgreSQL database (Debian: postgresql-client)")
    plain = url.set(drivername="postgresql", password=None).render_as_string()
    command = [program, "--format=custom", "--no-owner", f"--file={target}", f"--dbname={plain}"]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PGPASSWORD": url.password or ""})
    if done.returncode:
        raise ResourceError(f"pg_dump: {(done.stderr.strip().splitlines() or ['it failed'])[-1]}")
