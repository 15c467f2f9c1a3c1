"""Content-addressed artifacts."""

import os
import threading
from hashlib import sha256
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tracemesh.storage.artifacts import ArtifactStore
from tracemesh.storage.database import Database
from tracemesh.storage.models import ArtifactRow
from tracemesh.storage.reconstructions import create_reconstruction
from tracemesh.storage.sessions import create_session
from tracemesh.wire.resources import ReconstructionParameters, SessionCreate


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.binary(max_size=200), max_size=5))
def test_contents_are_kept_once_under_their_digest(tmp_path: Path, contents: list[bytes]) -> None:
    folder = tmp_path / sha256(repr(contents).encode()).hexdigest()
    store = ArtifactStore(folder)
    digests = [store.put(content) for content in contents * 2]
    assert digests == [sha256(content).hexdigest() for content in contents * 2]
    assert [store.path(digest).read_bytes() for digest in digests] == contents * 2
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert len(files) == len(set(contents))


def test_many_writers_of_one_content(tmp_path: Path) -> None:
    store, content = ArtifactStore(tmp_path), bytes(range(256)) * 4000
    threads = [threading.Thread(target=store.put, args=(content,)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (only,) = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert only.read_bytes() == content


def test_only_old_contents_that_nobody_names_are_removed(database: Database, tmp_path: Path) -> None:
    store = ArtifactStore(tmp_path / "artifacts")
    named, orphan, young = (store.put(content) for content in (b"named", b"orphan", b"young"))
    interrupted = tmp_path / "artifacts" / "tmp1234"
    interrupted.write_bytes(b"half")
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        job = create_reconstruction(transaction, "s", ReconstructionParameters()).id
        transaction.add(ArtifactRow(reconstruction_id=job, name="mesh.glb", sha256=named, size=5))
    for file in (store.path(named), store.path(orphan), interrupted):
        os.utime(file, (0, 0))
    with database.read() as transaction:
        assert store.remove_unreferenced(transaction) == 2
    left = {file for file in (tmp_path / "artifacts").rglob("*") if file.is_file()}
    assert left == {store.path(named), store.path(young)}
