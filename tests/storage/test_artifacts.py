"""Content-addressed artifacts."""

import os
import pickle
import threading
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tracemesh.errors import NotFound, Unavailable
from tracemesh.storage.artifacts import ArtifactStore
from tracemesh.storage.bucket import Bucket
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


def test_what_another_machine_stored_comes_from_the_bucket(s3: Any, tmp_path: Path) -> None:
    here, there = (ArtifactStore(tmp_path / name, s3.bucket) for name in ("here", "there"))
    digest = here.put(b"content")
    assert there.path(digest).read_bytes() == b"content"
    sent = pickle.loads(pickle.dumps(here))
    assert sent.path(digest) == here.path(digest)
    with pytest.raises(NotFound, match="no such content"):
        there.path("0" * 64)
    Bucket(s3.bucket).put(sha256(b"other").hexdigest(), b"damaged")
    with pytest.raises(Unavailable, match="damaged"):
        there.path(sha256(b"other").hexdigest())
    s3.stop()
    assert there.path(digest).read_bytes() == b"content"  # kept here, too
    with pytest.raises(Unavailable, match=f"the bucket {s3.bucket} cannot be used"):
        here.put(b"more")
    s3.start()
    here.put(b"more")


def test_the_folder_before_a_bucket_stays_small(s3: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tracemesh.storage.artifacts.CACHE_BYTES", 2500)
    store = ArtifactStore(tmp_path, s3.bucket)
    digests = [store.put(bytes([number]) * 1000) for number in range(5)]
    assert len([file for file in tmp_path.rglob("*") if file.is_file()]) == 2
    assert [store.path(digest).read_bytes()[0] for digest in digests] == [0, 1, 2, 3, 4]


def test_what_nobody_names_is_removed_from_the_bucket(database: Database, s3: Any, tmp_path: Path) -> None:
    store = ArtifactStore(tmp_path / "artifacts", s3.bucket)
    named, orphan = store.put(b"named"), store.put(b"orphan")
    _name(database, named)
    with database.read() as transaction:
        assert store.remove_unreferenced(transaction) == 0  # all too young
        assert store.remove_unreferenced(transaction, min_age=-60) == 1
    elsewhere = ArtifactStore(tmp_path / "elsewhere", s3.bucket)
    assert elsewhere.path(named).read_bytes() == b"named"
    with pytest.raises(NotFound):
        elsewhere.path(orphan)


def _name(database: Database, digest: str) -> None:
    """Have a reconstruction name this content."""
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        job = create_reconstruction(transaction, "s", ReconstructionParameters()).id
        transaction.add(ArtifactRow(reconstruction_id=job, name="mesh.glb", sha256=digest, size=5))


def test_only_old_contents_that_nobody_names_are_removed(database: Database, tmp_path: Path) -> None:
    store = ArtifactStore(tmp_path / "artifacts")
    named, orphan, young = (store.put(content) for content in (b"named", b"orphan", b"young"))
    interrupted = tmp_path / "artifacts" / "tmp1234"
    interrupted.write_bytes(b"half")
    _name(database, named)
    for file in (store.path(named), store.path(orphan), interrupted):
        os.utime(file, (0, 0))
    with database.read() as transaction:
        assert store.remove_unreferenced(transaction) == 2
    left = {file for file in (tmp_path / "artifacts").rglob("*") if file.is_file()}
    assert left == {store.path(named), store.path(young)}
