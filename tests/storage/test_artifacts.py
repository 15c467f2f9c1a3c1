"""Content-addressed artifacts."""

import threading
from hashlib import sha256
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tracemesh.storage.artifacts import ArtifactStore


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
