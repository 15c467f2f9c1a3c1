"""Artifacts: files that a reconstruction leaves, each kept once under the SHA-256 of its content."""

import os
import tempfile
import time
from hashlib import sha256
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import NotFound
from tracemesh.storage.models import ArtifactRow

MEDIA_TYPES = {"network.json": "application/json", "mesh.glb": "model/gltf-binary", "report.json": "application/json"}
"""Files that a reconstruction may leave."""


class ArtifactStore:
    """Contents by their digest, in a folder."""

    def __init__(self, folder: Path) -> None:
        """Keep contents in `folder`, which is made when it is missing."""
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def put(self, content: bytes) -> str:
        """Store durably, or keep what is there already; the digest."""
        digest = sha256(content).hexdigest()
        target = self.path(digest)
        if target.exists():
            target.touch()
        else:
            target.parent.mkdir(exist_ok=True)
            self._write(target, content)
        return digest

    def path(self, digest: str) -> Path:
        """Where a content is."""
        return self._folder / digest[:2] / digest

    def remove_unreferenced(self, transaction: Transaction, min_age: float = 3600.0) -> int:
        """Delete contents that no reconstruction has, and pieces of interrupted writes; how many.

        Files younger than `min_age` (s) stay: a running job stores its contents before it names them.
        """
        known = set(transaction.scalars(select(ArtifactRow.sha256)))
        latest = time.time() - min_age
        files = [file for file in self._folder.rglob("*") if file.is_file() and file.name not in known]
        old = [file for file in files if file.stat().st_mtime <= latest]
        for file in old:
            file.unlink(missing_ok=True)
        return len(old)

    def _write(self, target: Path, content: bytes) -> None:
        """Whole or not at all, also when the machine stops."""
        with tempfile.NamedTemporaryFile(dir=self._folder, delete=False) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(file.name).replace(target)


def artifact_row(transaction: Transaction, reconstruction: str, name: str) -> ArtifactRow:
    """Row of an artifact; raises NotFound."""
    row = transaction.get(ArtifactRow, (reconstruction, name))
    if row is None:
        raise NotFound(f"reconstruction {reconstruction} has no {name}")
    return row
