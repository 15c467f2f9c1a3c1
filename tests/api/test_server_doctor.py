"""The server's doctor names what is wrong, and what to do; a sound server gets a clean bill."""

import http.server
import os
import shutil
import socket
import threading
from datetime import datetime, timedelta, tzinfo
from pathlib import Path
from typing import Any

import pytest
from pydantic import SecretStr

from tracemesh.cli import main
from tracemesh.doctor import examine
from tracemesh.settings import Settings
from tracemesh.storage.database import Database
from tracemesh.storage.models import ArtifactRow
from tracemesh.storage.reconstructions import create_reconstruction
from tracemesh.storage.sessions import create_session
from tracemesh.wire.resources import ReconstructionParameters, SessionCreate


def complaints(**options: Any) -> list[str]:
    return [finding.what for finding in examine(Settings(**options)) if finding.advice]


def test_a_sound_server_gets_a_clean_bill_and_a_missing_folder_stays_missing(
    plain_server_process: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain_server_process.start()
    with pytest.raises(SystemExit, match="0"):
        main(["doctor", "--data-dir", str(plain_server_process.data_dir), "--port", str(plain_server_process.port)])
    told = capsys.readouterr().out
    assert "!!" not in told
    assert "a server answers" in told
    assert complaints(data_dir=tmp_path / "new" / "one", port=1) == []
    assert not (tmp_path / "new").exists()


def test_each_fault_of_database_and_artifacts_is_named(database_url: str, tmp_path: Path) -> None:
    options = {"database_url": database_url, "data_dir": tmp_path, "port": 1}
    database = Database(database_url)
    database.migrate()
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        job = create_reconstruction(transaction, "s", ReconstructionParameters()).id
        transaction.add(ArtifactRow(reconstruction_id=job, name="mesh.glb", sha256="ab" * 32, size=1))
    (lost,) = complaints(**options)
    assert "1 are missing" in lost
    with database.write() as transaction:
        transaction.connection().exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    (older,) = complaints(**options)
    assert "schema 9999; this program wants" in older
    database.close()


def test_a_database_that_is_away_or_damaged_is_named(tmp_path: Path) -> None:
    (away,) = complaints(database_url="postgresql://nobody@127.0.0.1:1/none", data_dir=tmp_path, port=1)
    assert away.startswith("postgresql does not answer")
    (tmp_path / "tracemesh.db").write_bytes(b"not a database, " * 500)
    (damaged,) = complaints(data_dir=tmp_path, port=1)
    assert "file is not a database" in damaged


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (folder,) = complaints(data_dir=tmp_path / "file" / "below", port=1)
    assert folder.startswith("data folder")


def test_a_full_disk_is_seen_coming(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage._replace(free=2**20))
    (full,) = complaints(data_dir=tmp_path, port=1)
    assert full.endswith("0.0 GiB free")


def test_a_stranger_at_the_port_is_named(tmp_path: Path) -> None:
    with http.server.HTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler) as stranger:
        thread = threading.Thread(target=stranger.serve_forever)
        thread.start()
        (told,) = complaints(data_dir=tmp_path, port=stranger.server_address[1])
        stranger.shutdown()
        thread.join()
    assert told.startswith("something else than tracemesh listens")


def test_a_scheduler_that_is_away_is_named(tmp_path: Path) -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        (away,) = complaints(data_dir=tmp_path, port=1, executor=f"dask://127.0.0.1:{port}")
        listener.listen()
        assert complaints(data_dir=tmp_path, port=1, executor=f"dask://127.0.0.1:{port}") == []
    assert away.startswith(f"no dask scheduler at 127.0.0.1:{port}")


def test_a_clock_that_was_set_back_is_named(database_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = {"database_url": database_url, "data_dir": tmp_path, "port": 1}
    database = Database(database_url)
    database.migrate()
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
    database.close()
    assert complaints(**options) == []

    class Behind(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> "Behind":
            return super().now(tz) - timedelta(minutes=1)

    monkeypatch.setattr("tracemesh.doctor.datetime", Behind)
    (told,) = complaints(**options)
    wanted = (
        "and that of postgresql are 60 s apart" if database_url.startswith("postgresql") else "60 s before the newest"
    )
    assert wanted in told


def test_a_bucket_that_is_away_is_named(s3: Any, tmp_path: Path) -> None:
    options = {"data_dir": tmp_path, "port": 1, "artifact_bucket": s3.bucket, "token": SecretStr("x" * 20)}
    Database(Settings(**options).resolved_database_url).migrate()
    assert complaints(**options) == []
    s3.stop()
    (away,) = complaints(**options)
    assert s3.bucket in away
    assert "AWS_ENDPOINT_URL" in os.environ
    s3.start()
