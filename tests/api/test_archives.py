"""A session in one file: out and in again is the identity; a damaged file leaves nothing."""

import io
import json
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import ROOT
from tracemesh.storage.database import Database
from tracemesh.storage.sessions import list_sessions


@pytest.fixture
def session(server: Any, ride: Any, line: Any, shared_data: Path) -> str:
    """Two recordings whose curves were begun in turn, an edit, a removed curve, and a reconstruction."""
    made: str = server.new_session(name="Everything")
    riders = [ride(name, made) for name in ("left", "right")]
    for curve in range(2):
        for rider in riders:
            for seq, message in enumerate(line(20, curve=curve), curve * 6):
                rider.send({**message, "seq": seq})
            rider.wait_for_ack(curve * 6 + 5)
    for index in range(4):
        server.http.patch(f"/sessions/{made}/curves/{index}", json={"removed": True})
    scan = (shared_data / "lilium.rawnet").read_bytes()
    server.http.post(f"/sessions/{made}/recordings", content=scan).raise_for_status()
    job = server.http.post(f"/sessions/{made}/reconstructions", json={"step": "3%", "surface": False}).json()["id"]
    while server.http.get(f"/reconstructions/{job}").json()["state"] in ("queued", "running"):
        time.sleep(0.05)
    server.http.patch(f"/sessions/{made}/curves/1", json={"removed": False, "marks": [{"sample": 3, "node": 77}]})
    return made


def everything(server: Any, session: str) -> list[Any]:
    """All that the API tells of a session, less identifiers and times of its own."""
    told = server.http.get(f"/sessions/{session}").json()
    jobs = server.http.get(f"/sessions/{session}/reconstructions").json()
    recordings = server.http.get(f"/sessions/{session}/recordings").json()
    return [
        [told[k] for k in ("name", "curves", "samples", "nodes")],
        server.http.get(f"/sessions/{session}/curves").json(),
        [server.http.get(f"/sessions/{session}/recordings/{r['id']}").content for r in recordings],
        [(j["state"], j["parameters"], j["created"], j["finished"]) for j in jobs],
        [server.http.get(url.removeprefix("/api/v1")).content for j in jobs for url in j["artifacts"].values()],
    ]


def restore(server: Any, archive: bytes) -> Any:
    return server.http.post("/sessions/archive", content=archive)


def changed(archive: bytes, name: str, content: bytes | None) -> bytes:
    """The archive with one file replaced, or left out."""
    result = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(archive)) as old, zipfile.ZipFile(result, "w") as new:
        for entry in old.namelist():
            if entry != name:
                new.writestr(entry, old.read(entry))
        if content is not None:
            new.writestr(name, content)
    return result.getvalue()


def test_out_and_in_again_is_the_identity(server: Any, session: str) -> None:
    archive = server.http.get(f"/sessions/{session}/archive").content
    answer = restore(server, archive)
    assert answer.status_code == 201, answer.text
    assert answer.json()["id"] != session
    assert everything(server, answer.json()["id"]) == everything(server, session)
    again = server.http.get(f"/sessions/{answer.json()['id']}/archive").content
    with zipfile.ZipFile(io.BytesIO(archive)) as one, zipfile.ZipFile(io.BytesIO(again)) as two:
        assert {n: one.read(n) for n in one.namelist()} == {n: two.read(n) for n in two.namelist()}
    _damage_leaves_nothing(server, archive)


def _damage_leaves_nothing(server: Any, archive: bytes) -> None:
    with zipfile.ZipFile(io.BytesIO(archive)) as file:
        manifest = json.loads(file.read("session.json"))
    artifact = next(name for name in manifest["files"] if name.startswith("artifacts/"))
    missing_curve = {**manifest, "curves": manifest["curves"][1:]}
    beyond = json.loads(json.dumps(manifest))
    beyond["curves"][0]["marks"] = [{"sample": 10**6, "node": 1}]
    before = len(server.http.get("/sessions?limit=500").json())
    for damaged, says in [
        (b"", "archive"),
        (b"PK no zip", "archive"),
        (archive[: len(archive) // 2], "archive"),
        (changed(archive, "session.json", None), "session.json"),
        (changed(archive, "session.json", b"{}"), "session.json"),
        (changed(archive, artifact, None), artifact),
        (changed(archive, artifact, b"other"), "not what was archived"),
        (changed(archive, "session.json", json.dumps(missing_curve).encode()), "not those of its recordings"),
        (changed(archive, "session.json", json.dumps(beyond).encode()), "20 samples"),
    ]:
        answer = restore(server, damaged)
        assert answer.status_code == 422, says
        assert says in answer.json()["detail"]
    assert len(server.http.get("/sessions?limit=500").json()) == before


KILLED = """
import os, sys
from pathlib import Path
from tests.killing import kill_before
from tracemesh.api.routes.archives import restored
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import open_artifacts
from tracemesh.storage.database import Database

settings = Settings(database_url=sys.argv[1], data_dir=Path(sys.argv[2]))

def take_in(statements):
    database = Database(settings.resolved_database_url)
    kill_before(database, statements)
    with open(sys.argv[3], "rb") as file:
        restored(database, open_artifacts(settings), file, 10**9, "derived")

for statements in map(int, sys.argv[4:]):
    if (child := os.fork()) == 0:
        take_in(statements)
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
"""Takes in an archive again and again, in processes that kill themselves before a certain statement."""


def test_a_restore_that_is_killed_leaves_nothing_and_asking_again_makes_it_whole(
    server: Any, session: str, new_database: Any, database_kind: str, tmp_path: Path
) -> None:
    archive, url = tmp_path / "archive.zip", new_database(database_kind)
    archive.write_bytes(server.http.get(f"/sessions/{session}/archive").content)
    database = Database(url)
    database.migrate()

    def run(*statements: int) -> list[int]:
        command = [sys.executable, "-c", KILLED, url, tmp_path, archive, *map(str, statements)]
        done = subprocess.run(command, stdout=subprocess.PIPE, check=True, cwd=ROOT)
        return list(map(int, done.stdout.split()))

    def known() -> list[tuple[int, int]]:
        with database.read() as transaction:
            return [(s.curves, s.samples) for s in list_sessions(transaction, 10)]

    assert run(3, 12, 25, 40) == [-signal.SIGKILL] * 4
    assert known() == []
    told = server.http.get(f"/sessions/{session}").json()
    assert run(10**6, 10**6) == [0, 0]
    assert known() == [(told["curves"], told["samples"])]
    database.close()


def test_a_bomb_is_not_unpacked(start_server: Any) -> None:
    small = start_server(max_session_bytes=100_000)
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("session.json", b"0" * 50_000_000)
    answer = restore(small, bomb.getvalue())
    assert (answer.status_code, "100000 bytes when unpacked" in answer.json()["detail"]) == (422, True)
