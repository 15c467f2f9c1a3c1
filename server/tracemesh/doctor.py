"""Tells in plain words what is wrong with a server, and what to do about it; changes nothing but a probe of its own."""

import shutil
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from http.client import HTTPException
from pathlib import Path
from urllib.request import ProxyHandler, build_opener

from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from tracemesh.api.routes.pages import WEB
from tracemesh.errors import ResourceError, Unavailable
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import open_artifacts
from tracemesh.storage.database import Database, fault_in_words

LITTLE_SPACE = 2**30
"""Bytes on a disk below which it is full soon."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at. advice: what to do; empty if all is well."""

    what: str
    advice: str = ""

    def __str__(self) -> str:
        """As a person reads it."""
        return f"  ok  {self.what}" if not self.advice else f"  !!  {self.what}\n      {self.advice}"


def examine(settings: Settings) -> Iterator[Finding]:
    """Look at folder, database, artifacts, page and port; what depends on something broken is not looked at."""
    folder = check_folder(settings)
    yield folder
    if not folder.advice:
        yield from check_database(settings)
    yield check_page()
    yield check_port(settings)


def check_folder(settings: Settings) -> Finding:
    """Whether the data folder can be written, and has room."""
    folder = settings.data_dir
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / "doctor.probe"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        return Finding(
            f"data folder {folder}: {error.strerror}", "give it to the user who runs the server, or --data-dir"
        )
    free = shutil.disk_usage(folder).free
    advice = "free some, or move the data folder: a full disk ends scanning" if free < LITTLE_SPACE else ""
    return Finding(f"data folder {folder}, {free / 2**30:.1f} GiB free", advice)


def check_database(settings: Settings) -> Iterator[Finding]:
    """Whether the database answers, is whole and is of this version; and the artifacts that it names are there."""
    try:
        database = Database(settings.resolved_database_url)
    except ResourceError as error:
        yield Finding(str(error), "install it, or unset TRACEMESH_DATABASE_URL to use SQLite")
        return
    kind, file = database.engine.dialect.name, database.engine.url.database
    try:
        if kind == "sqlite" and not Path(str(file)).is_file():
            yield Finding(f"no database yet; the first tracemesh serve makes {file}")
            return
        present, wanted = database.versions()
        yield _version(kind, present, wanted)
        if kind == "sqlite":
            yield _whole(database)
        if present == wanted:
            yield _artifacts(settings, database)
    except SQLAlchemyError as error:
        yield Finding(f"{kind} does not answer: {fault_in_words(error)}", "start it, or correct TRACEMESH_DATABASE_URL")
    finally:
        database.close()


def check_page() -> Finding:
    """Whether the web page was built."""
    built = (WEB / "index.html").is_file()
    return Finding("web page" if built else "the web page is not built", "" if built else "run make setup")


def check_port(settings: Settings) -> Finding:
    """Whether our server answers at its address, or could."""
    host = "127.0.0.1" if settings.host in ("0.0.0.0", "::") else settings.host
    where = f"{settings.host}:{settings.port}"
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.settimeout(5)
        if probe.connect_ex((host, settings.port)) != 0:
            return Finding(f"no server runs at {where}; the port is free")
    try:
        name = f"[{host}]" if ":" in host else host
        with build_opener(ProxyHandler({})).open(f"http://{name}:{settings.port}/healthz", timeout=5) as answer:
            ours = answer.read() == b"ok\n"
    except (OSError, HTTPException):
        ours = False
    if ours:
        return Finding(f"a server answers at {where}")
    return Finding(f"something else than tracemesh listens at {where}", "stop it, or choose another --port")


def _version(kind: str, present: str | None, wanted: str | None) -> Finding:
    if present == wanted or present is None:
        return Finding(f"{kind}, {'still empty' if present is None else f'schema {present}'}")
    advice = "tracemesh serve brings an older one up to date; of a newer one, use the newer tracemesh"
    return Finding(f"{kind}, schema {present}; this program wants {wanted}", advice)


def _whole(database: Database) -> Finding:
    with database.engine.connect() as connection:
        answer = str(connection.execute(text("PRAGMA quick_check(1)")).scalar())
    damaged = answer != "ok"
    return Finding(f"database file: {answer}", "restore a backup; keep the damaged file" if damaged else "")


def _artifacts(settings: Settings, database: Database) -> Finding:
    where = settings.artifact_bucket or str(settings.artifact_dir)
    try:
        with database.read() as transaction:
            lost = open_artifacts(settings).lacking(transaction)
    except (ResourceError, OSError) as error:
        advice = "see that it runs, and AWS_ENDPOINT_URL, AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION"
        return Finding(str(error), advice if isinstance(error, Unavailable) else "see who may read it")
    told = f"artifacts in {where}" + (f": {len(lost)} are missing, {lost[0]} first" if lost else "")
    return Finding(told, "restore them from a backup, or reconstruct again" if lost else "")
