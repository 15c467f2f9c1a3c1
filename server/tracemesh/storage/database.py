"""The database: one engine, short transactions, one schema kept by migrations.

Alembic is imported where it has something to do: most starts find the schema as it should be, or none at all, and are
sooner without.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Column, Engine, MetaData, String, Table, create_engine, event, inspect
from sqlalchemy.engine import Connection, make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session
from sqlalchemy.pool import ConnectionPoolEntry

from tracemesh.errors import ResourceError
from tracemesh.storage.models import Base
from tracemesh.storage.postgresql import postgresql_engine

if TYPE_CHECKING:
    from alembic.config import Config

MAX_WAL_PAGES = 16_384
"""Pages (of 4 KiB) of SQLite's log at which a writer begins it anew; by then nearly all are in the main file."""
BUSY_TIMEOUT = 30
"""s that SQLite waits for another writer."""


class Database:
    """Opens transactions. Every committed write survives a crash of the process and of the machine."""

    def __init__(self, url: str) -> None:
        """Open `url` (SQLAlchemy's form)."""
        self.engine = _engine(url)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A transaction that only reads."""
        with Session(self.engine, expire_on_commit=False) as session, session.begin():
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A transaction that may write; committed at the end, rolled back on an exception."""
        with (
            self.engine.connect().execution_options(writes=True) as connection,
            connection.begin(),
            Session(connection, expire_on_commit=False, join_transaction_mode="rollback_only") as session,
        ):
            yield session
            session.flush()

    def checkpoint(self) -> None:
        """Copy what was committed to SQLite's log into its main file, while others read and write.

        Without it a writer does so itself, in the middle of its work, and waits for the disk.
        """
        if self.engine.dialect.name == "sqlite":
            with closing(self.engine.raw_connection()) as connection:
                connection.cursor().execute("PRAGMA wal_checkpoint(PASSIVE)")

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()

    def migrate(self, revision: str | None = None) -> None:
        """Bring the schema up to this revision, or the newest: wholly or, when it fails, not at all."""
        present, newest = self.versions()
        if present == (revision or newest):
            return
        with self.engine.connect().execution_options(writes=True) as connection, connection.begin():
            if connection.dialect.name == "postgresql":
                connection.exec_driver_sql("SELECT pg_advisory_xact_lock(7262726564)")
            if revision is None and not inspect(connection).get_table_names():
                _create(connection, newest)
            else:
                _upgrade(connection, revision or newest)

    def versions(self) -> tuple[str | None, str]:
        """The schema's version, none in an empty database, and the one that this program wants."""
        with self.engine.connect() as connection:
            there = inspect(connection).has_table("alembic_version")
            present = connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar() if there else None
        return present, newest_revision()


def _create(connection: Connection, newest: str) -> None:
    """The newest schema in an empty database; the migrations end with the same one."""
    version = Table("alembic_version", MetaData(), Column("version_num", String(32), primary_key=True))
    for tables in (Base.metadata, version.metadata):
        tables.create_all(connection, checkfirst=False)
    connection.execute(version.insert(), {"version_num": newest})


def _upgrade(connection: Connection, revision: str) -> None:
    from alembic import command

    config = migrations()
    config.attributes["connection"] = connection
    command.upgrade(config, revision)


@contextmanager
def database_faults_in_words() -> Iterator[None]:
    """Turn what a database's driver raises into a ResourceError of one line."""
    try:
        yield
    except SQLAlchemyError as error:
        raise ResourceError(f"the database cannot be used: {fault_in_words(error)}") from None


def fault_in_words(error: SQLAlchemyError) -> str:
    """What the driver said, in one line."""
    return str(getattr(error, "orig", None) or error).splitlines()[0]


def newest_revision() -> str:
    """Of the schema: each of its migrations is in a file whose name begins with its number."""
    folder = files("tracemesh.storage.migrations.versions")
    return max(file.name.partition("_")[0] for file in folder.iterdir() if file.name[0].isdigit())


def migrations() -> "Config":
    """Where alembic finds the schema's history."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", "tracemesh.storage:migrations")
    return config


def _engine(url: str) -> Engine:
    parsed = make_url(url)
    if parsed.get_backend_name() != "sqlite":
        return postgresql_engine(parsed)
    if parsed.database:
        Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
    engine = create_engine(parsed, connect_args={"timeout": BUSY_TIMEOUT, "check_same_thread": False})
    event.listen(engine, "connect", _configure_sqlite)
    event.listen(engine, "begin", _begin_sqlite)
    return engine


def _configure_sqlite(connection: DBAPIConnection, _record: ConnectionPoolEntry) -> None:
    connection.isolation_level = None  # transactions begin where SQLAlchemy says
    cursor = connection.cursor()
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", f"wal_autocheckpoint={MAX_WAL_PAGES}"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _begin_sqlite(connection: Connection) -> None:
    """A writer takes the lock at once: one that began as a reader could not wait for it."""
    connection.exec_driver_sql("BEGIN IMMEDIATE" if connection.get_execution_options().get("writes") else "BEGIN")
