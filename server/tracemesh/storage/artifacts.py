"""Artifacts: files that a reconstruction leaves, each kept once under the SHA-256 of its content."""

import os
import tempfile
import time
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import NotFound, Unavailable
from tracemesh.settings import Settings
from tracemesh.storage.bucket import Bucket
from tracemesh.storage.models import ArtifactRow

MEDIA_TYPES = {"network.json": "application/json", "mesh.glb": "model/gltf-binary", "report.json": "application/json"}
"""Files that a reconstruction may leave."""
CACHE_BYTES = 2**30
"""Most bytes that are kept in the folder when a bucket has everything."""


class ArtifactStore:
    """Contents by their digest in a folder or, when there is a bucket, in the bucket; then the folder is its cache.

    Can be sent to another process, on another machine too if there is a bucket.
    """

    def __init__(self, folder: Path, bucket: str = "") -> None:
        """Keep contents in `folder`, which is made when it is needed, and in the bucket with this URL, if any."""
        self._folder = folder
        self._bucket = Bucket(bucket) if bucket else None

    def __reduce__(self) -> tuple[type["ArtifactStore"], tuple[Path, str]]:
        """How it is sent to another process: without connections."""
        return ArtifactStore, (self._folder, self._bucket.url if self._bucket else "")

    def put(self, content: bytes) -> str:
        """Store durably, or keep what is there already; the digest. Raises Unavailable when a bucket is away."""
        digest = sha256(content).hexdigest()
        if self._bucket is not None:
            self._bucket.put(digest, content)  # again, too: it is as young as the job that stores it
        self._keep(digest, content)
        return digest

    def path(self, digest: str) -> Path:
        """A file with this content; raises NotFound or, when a bucket is away or its content damaged, Unavailable."""
        target = self._target(digest)
        if self._bucket is not None and not self.has(digest):
            content = self._bucket.get(digest)
            if sha256(content).hexdigest() != digest:
                raise Unavailable(f"what the bucket {self._bucket.url} has as {digest} is damaged")
            self._keep(digest, content)
        if not self.has(digest):
            raise NotFound(f"the artifacts in {self._folder} lack {digest}")
        return target

    def has(self, digest: str) -> bool:
        """Whether the folder has it."""
        return self._target(digest).exists()

    def lacking(self, transaction: Transaction) -> list[str]:
        """Digests that reconstructions name and that are nowhere. Raises Unavailable."""
        there = {file.name for file in self._files()}
        if self._bucket is not None:
            there.update(self._bucket.names(datetime.now(UTC) + timedelta(days=1)))
        return sorted(set(transaction.scalars(select(ArtifactRow.sha256))) - there)

    def remove_unreferenced(self, transaction: Transaction, min_age: float = 3600.0) -> int:
        """Delete contents that no reconstruction has, and pieces of interrupted writes; how many.

        What is younger than `min_age` (s) stays: a running job stores its contents before it names them.
        """
        known = set(transaction.scalars(select(ArtifactRow.sha256)))
        latest = time.time() - min_age
        gone = {file.name for file in self._files() if file.name not in known and _unlink_if_older(file, latest)}
        if self._bucket is not None:
            names = {name for name in self._bucket.names(datetime.fromtimestamp(latest, UTC)) if name not in known}
            self._bucket.remove(sorted(names))
            gone |= names
        return len(gone)

    def _target(self, digest: str) -> Path:
        return self._folder / digest[:2] / digest

    def _files(self) -> list[Path]:
        return [file for file in self._folder.rglob("*") if file.is_file()]

    def _keep(self, digest: str, content: bytes) -> None:
        target = self._target(digest)
        try:
            os.utime(target)  # as young as the job that stores it
        except (FileNotFoundError, NotADirectoryError):
            target.parent.mkdir(parents=True, exist_ok=True)
            self._write(target, content)
            if self._bucket is not None:
                self._shrink()

    def _shrink(self) -> None:
        """Forget what was stored or fetched longest ago; the bucket has it."""
        files = sorted(self._files(), key=lambda file: file.stat().st_mtime, reverse=True)
        size = 0
        for file in files:
            size += file.stat().st_size
            if size > CACHE_BYTES and file is not files[0]:
                file.unlink(missing_ok=True)

    def _write(self, target: Path, content: bytes) -> None:
        """Whole or not at all, also when the machine stops."""
        with tempfile.NamedTemporaryFile(dir=self._folder, delete=False) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(file.name).replace(target)


def _unlink_if_older(file: Path, latest: float) -> bool:
    try:
        old = file.stat().st_mtime <= latest
        if old:
            file.unlink()
    except FileNotFoundError:  # another server was faster
        return False
    return old


def open_artifacts(settings: Settings) -> ArtifactStore:
    """The store that the settings name. Raises OSError when its folder cannot be made."""
    settings.artifact_dir.mkdir(parents=True, exist_ok=True)
    return ArtifactStore(settings.artifact_dir, settings.artifact_bucket)


def artifact_row(transaction: Transaction, reconstruction: str, name: str) -> ArtifactRow:
    """Row of an artifact; raises NotFound."""
    row = transaction.get(ArtifactRow, (reconstruction, name))
    if row is None:
        raise NotFound(f"reconstruction {reconstruction} has no {name}")
    return row
