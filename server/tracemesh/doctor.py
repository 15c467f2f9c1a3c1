"""Tells in plain words what is wrong with a server, and what to do about it; changes nothing but a probe of its own."""

import shutil
import socket
import ssl
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from http.client import HTTPException
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import HTTPSHandler, ProxyHandler, build_opener

from sqlalchemy import func, make_url, select, text
from sqlalchemy.exc import SQLAlchemyError

from tracemesh.api.routes.pages import WEB
from tracemesh.errors import ResourceError, Unavailable
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import open_artifacts
from tracemesh.storage.database import Database, fault_in_words
from tracemesh.storage.models import SessionRow

LITTLE_SPACE = 2**30
"""Bytes on a disk below which it is full soon."""
CLOCKS_APART = timedelta(seconds=5)
"""Between two clocks beyond which leases of jobs and times of life of tokens are wrong."""
PATIENCE = 5.0
"""s to wait for an answer of the network."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at. advice: what to do; empty if all is well."""

    what: str
    advice: str = ""

    def __str__(self) -> str:
        """As a person reads it."""
        return f"  ok  {self.what}" if not self.advice else f"  !!  {self.what}\n      {self.advice}"


def examine(settings: Settings) -> Iterator[Finding]:
    """Look at folder, database, artifacts, executor, page and port; not at what depends on something broken."""
    folder = check_folder(settings)
    yield folder
    if not folder.advice:
        yield from check_database(settings)
    if settings.cluster_address is not None:
        yield check_cluster(settings.cluster_address)
    yield check_page()
    yield check_port(settings)


def check_folder(settings: Settings) -> Finding:
    """Whether the data folder, or the one to make it in, can be written and has room."""
    folder = settings.data_dir
    try:
        there = next(place for place in (folder, *folder.parents) if place.exists())
        probe = there / "doctor.probe"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        return Finding(
            f"data folder {folder}: {error.strerror}", "give it to the user who runs the server, or --data-dir"
        )
    free = shutil.disk_usage(there).free
    advice = "free some, or move the data folder: a full disk ends scanning" if free < LITTLE_SPACE else ""
    yet = "" if there == folder else ", made by the first tracemesh serve"
    return Finding(f"data folder {folder}{yet}, {free / 2**30:.1f} GiB free", advice)


def check_database(settings: Settings) -> Iterator[Finding]:
    """Whether the database answers, is whole and is of this version; and the artifacts that it names are there."""
    parsed = make_url(settings.resolved_database_url)
    if parsed.get_backend_name() == "sqlite" and not Path(str(parsed.database)).is_file():
        yield Finding(f"no database yet; the first tracemesh serve makes {parsed.database}")
        return
    try:
        database = Database(settings.resolved_database_url)
    except ResourceError as error:
        yield Finding(str(error), "install it, or unset TRACEMESH_DATABASE_URL to use SQLite")
        return
    kind = database.engine.dialect.name
    try:
        present, wanted = database.versions()
        yield _version(kind, present, wanted)
        if kind == "sqlite":
            yield _whole(database)
        if present == wanted:
            yield _clock(kind, database)
            yield _artifacts(settings, database)
    except SQLAlchemyError as error:
        yield Finding(f"{kind} does not answer: {fault_in_words(error)}", "start it, or correct TRACEMESH_DATABASE_URL")
    finally:
        database.close()


def check_cluster(address: str) -> Finding:
    """Whether somebody listens where the dask scheduler should."""
    place = urlsplit(address)
    try:
        socket.create_connection((place.hostname, place.port), PATIENCE).close()
    except OSError as error:
        advice = "start it, or correct TRACEMESH_EXECUTOR; until then reconstructions wait"
        return Finding(f"no dask scheduler at {place.netloc}: {error.strerror or error}", advice)
    return Finding(f"dask scheduler at {place.netloc}")


def check_page() -> Finding:
    """Whether the web page was built."""
    built = (WEB / "index.html").is_file()
    return Finding("web page" if built else "the web page is not built", "" if built else "run make setup")


def check_port(settings: Settings) -> Finding:
    """Whether our server answers at its address, or could."""
    host = "127.0.0.1" if settings.host in ("0.0.0.0", "::") else settings.host
    where = f"{settings.host}:{settings.port}"
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.settimeout(PATIENCE)
        if probe.connect_ex((host, settings.port)) != 0:
            return Finding(f"no server runs at {where}; the port is free")
    place = f"[{host}]:{settings.port}" if ":" in host else f"{host}:{settings.port}"
    if any(_is_ours(f"{scheme}://{place}/healthz") for scheme in ("http", "https")):
        return Finding(f"a server answers at {where}")
    return Finding(f"something else than tracemesh listens at {where}", "stop it, or choose another --port")


def _is_ours(url: str) -> bool:
    """Whether tracemesh answers there; whose certificate it is does not matter, nothing secret is said."""
    anybody = ssl.create_default_context()
    anybody.check_hostname, anybody.verify_mode = False, ssl.CERT_NONE
    try:
        with build_opener(ProxyHandler({}), HTTPSHandler(context=anybody)).open(url, timeout=PATIENCE) as answer:
            return bool(answer.read(16) == b"ok\n")
    except (OSError, HTTPException):
        return False


def _version(kind: str, present: str | None, wanted: str) -> Finding:
    if present == wanted or present is None:
        return Finding(f"{kind}, {'still empty' if present is None else f'schema {present}'}")
    advice = "tracemesh serve brings an older one up to date; of a newer one, use the newer tracemesh"
    return Finding(f"{kind}, schema {present}; this program wants {wanted}", advice)


def _clock(kind: str, database: Database) -> Finding:
    """Whether this machine's clock agrees with the database's, and is not before what was stored last."""
    with database.read() as transaction:
        stored = transaction.scalar(select(func.max(SessionRow.created)))
        theirs = transaction.scalar(select(func.now())) if kind == "postgresql" else None
    here = datetime.now(UTC)
    advice = "set the clocks by the network (NTP): jobs, tokens and times of scans go by them"
    if theirs is not None and abs(theirs - here) > CLOCKS_APART:
        return Finding(f"the clock here and that of {kind} are {_seconds(theirs - here)} apart", advice)
    if stored is not None and stored - here > CLOCKS_APART:
        return Finding(f"the clock is {_seconds(stored - here)} before the newest session: was it set back?", advice)
    return Finding("clock")


def _seconds(apart: timedelta) -> str:
    return f"{abs(apart).total_seconds():.0f} s"


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
