"""A backup made while devices go on sending is a server of its own, and whole."""

import json
import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from tracemesh.errors import ResourceError
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import ArtifactStore
from tracemesh.storage.backup import DUMP, back_up
from tracemesh.storage.database import Database
from tracemesh.storage.models import ArtifactRow
from tracemesh.storage.reconstructions import create_reconstruction
from tracemesh.storage.sessions import create_session, get_session
from tracemesh.wire.resources import ReconstructionParameters, SessionCreate


def run(*words: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tracemesh", *words]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment})


def reconstruct(http: Any, session: str) -> dict[str, str]:
    job = http.post(f"/sessions/{session}/reconstructions", json={"step": "6%", "surface": False}).json()["id"]
    while (state := http.get(f"/reconstructions/{job}").json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    return dict(state["artifacts"])


def test_a_backup_under_load_can_be_served_and_has_all_that_was_acknowledged_before(
    plain_server_process: Any, line: Any, shared_data: Path, tmp_path: Path
) -> None:
    server, copy = plain_server_process.start(), tmp_path / "copy"
    session = server.new_session(name="kept")
    server.http.post(f"/sessions/{session}/recordings", content=(shared_data / "lilium.rawnet").read_bytes())
    network = reconstruct(server.http, session)["network.json"].removeprefix("/api/v1")
    before = server.http.get(network).content
    hello = {"type": "hello", "recording": "r", "session": session, "device": {"id": "d", "kind": "test"}}
    stop = threading.Event()
    with server.connect("/ingest") as socket:
        socket.send(json.dumps(hello))
        socket.recv(timeout=60)
        sender = threading.Thread(target=_send, args=(socket, line(200_000, block=5), stop))
        sender.start()
        acknowledged = 0
        while acknowledged < 100:
            acknowledged = json.loads(socket.recv(timeout=60))["seq"]
        made = [run("backup", copy, "--data-dir", plain_server_process.data_dir) for _ in range(2)]
        stop.set()
        sender.join()
    assert [done.returncode for done in made] == [0, 0], made[0].stderr
    plain_server_process.kill()
    plain_server_process.data_dir = copy
    served = plain_server_process.start()
    assert served.http.get(f"/sessions/{session}").json()["name"] == "kept"
    messages = served.http.get(f"/sessions/{session}/recordings/r").text.splitlines()[1:]
    assert [json.loads(text)["seq"] for text in messages] == list(range(len(messages)))
    assert len(messages) > acknowledged
    assert served.http.get(network).content == before


def _send(socket: Any, messages: list[dict[str, Any]], stop: threading.Event) -> None:
    for message in messages:
        if stop.is_set():
            return
        socket.send(json.dumps(message))
        time.sleep(0.001)


def test_a_damaged_artifact_is_named(database_url: str, tmp_path: Path) -> None:
    settings = Settings(database_url=database_url, data_dir=tmp_path / "data")
    store, database = ArtifactStore(settings.artifact_dir), Database(settings.resolved_database_url)
    database.migrate()
    good, damaged, lost = store.put(b"good"), store.put(b"damaged"), "0" * 64
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s", name="kept"))
        job = create_reconstruction(transaction, "s", ReconstructionParameters()).id
        for name, digest in (("mesh.glb", good), ("network.json", damaged), ("report.json", lost)):
            transaction.add(ArtifactRow(reconstruction_id=job, name=name, sha256=digest, size=1))
    database.close()
    store.path(damaged).write_bytes(b"rust")
    made = back_up(settings, tmp_path / "copy", lambda stage, fraction: None)
    assert set(made.lost) == {damaged, lost}
    assert ArtifactStore(tmp_path / "copy" / "artifacts").path(good).read_bytes() == b"good"
    if database_url.startswith("sqlite"):
        copied = Database(f"sqlite:///{made.database}")
        with copied.read() as transaction:
            assert get_session(transaction, "s").name == "kept"
        copied.close()
    else:
        assert made.database.name == DUMP
        assert made.database.read_bytes().startswith(b"PGDMP")


@pytest.mark.parametrize(
    ("folder", "where", "says"),
    [
        ("copy", "nothing", "there is no server's database"),
        ("data", "data", "wanted another folder than the data folder"),
        ("/proc/nowhere", "data", "the folder /proc/nowhere cannot be made: "),
    ],
)
def test_what_cannot_be_backed_up_is_said(folder: str, where: str, says: str, tmp_path: Path) -> None:
    Database(f"sqlite:///{tmp_path / 'data' / 'tracemesh.db'}").migrate()
    settings = Settings(data_dir=tmp_path / where)
    with pytest.raises(ResourceError, match=re.escape(says)):
        back_up(settings, tmp_path / folder, lambda stage, fraction: None)
