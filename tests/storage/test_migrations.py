"""A database of any earlier schema is brought up to date, and every row in it is kept."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from typing import Any

import pytest
from alembic.script import ScriptDirectory
from sqlalchemy import Column, Connection, MetaData, event, inspect, select

from tests.conftest import ROOT
from tracemesh.storage.database import Database, migrations, newest_revision
from tracemesh.storage.devices import list_devices
from tracemesh.storage.models import SessionRow

REVISIONS = [script.revision for script in ScriptDirectory.from_config(migrations()).walk_revisions()]
VALUES: dict[type, Any] = {str: "x", int: 3, float: 0.5, bool: True, bytes: b"{}", object: {"a": 1}}

KILLED = """
import sys
from tests.killing import kill_before
from tracemesh.storage.database import Database

database = Database(sys.argv[1])
kill_before(database, int(sys.argv[2]))
database.migrate()
"""
"""Migrates a database and kills itself before a certain statement."""

Rows = dict[str, dict[str, Any]]


def test_the_newest_revision_is_alembics_head() -> None:
    assert newest_revision() == ScriptDirectory.from_config(migrations()).get_current_head()


def value(column: Column[Any], rows: Rows) -> Any:
    """Something that fits; what refers to another table refers to its row."""
    for key in column.foreign_keys:
        return rows[key.column.table.name][key.column.name]
    kind = column.type.python_type
    return datetime(2026, 1, 2, tzinfo=UTC) if kind is datetime else VALUES[kind]


def fill(connection: Connection) -> Rows:
    """One row in every table, every column of it."""
    schema, rows = reflected(connection), Rows()
    for table in schema.sorted_tables:
        if table.name != "alembic_version":
            rows[table.name] = {column.name: value(column, rows) for column in table.columns}
            connection.execute(table.insert(), rows[table.name])
    return rows


def reflected(connection: Connection) -> MetaData:
    schema = MetaData()
    schema.reflect(connection)
    return schema


@pytest.fixture
def databases() -> Iterator[Callable[[str], Database]]:
    """Open databases; all are closed after the test."""
    with ExitStack() as stack:
        yield lambda url: stack.enter_context(closing(Database(url)))


@pytest.mark.parametrize("revision", REVISIONS)
def test_every_row_of_an_earlier_schema_is_kept(
    revision: str, database_url: str, databases: Callable[[str], Database]
) -> None:
    database = databases(database_url)
    database.migrate(revision)
    with database.engine.begin() as connection:
        rows = fill(connection)
    assert {"sessions", "recordings", "messages", "curves", "marks", "reconstructions", "artifacts"} <= set(rows)
    database.migrate()
    with database.engine.begin() as connection:
        schema = reflected(connection)
        for name, row in rows.items():
            kept = [column for column in schema.tables[name].columns if column.name in row]
            (found,) = connection.execute(select(*kept)).mappings()
            told = {column: v.replace(tzinfo=UTC) if isinstance(v, datetime) else v for column, v in found.items()}
            assert told == {column.name: row[column.name] for column in kept}, name


def described(database: Database) -> dict[str, Any]:
    """All that a schema says of each table, in no order."""
    with database.engine.connect() as connection:
        seen, tables = inspect(database.engine), reflected(connection).tables
    return {
        name: {
            "columns": {
                c.name: (str(c.type), c.nullable, str(c.server_default and c.server_default.arg)) for c in table.columns
            },
            "keys": [column.name for column in table.primary_key],
            "references": {
                (*key["constrained_columns"], key["referred_table"], *key["options"].items())
                for key in seen.get_foreign_keys(name)
            },
            "unique": {tuple(u["column_names"]) for u in seen.get_unique_constraints(name)},
            "indexes": {(i["name"], *i["column_names"], bool(i["unique"])) for i in seen.get_indexes(name)},
            "counts on": bool(table.dialect_options["sqlite"]["autoincrement"]),
        }
        for name, table in tables.items()
    }


def test_an_empty_database_gets_the_schema_that_the_migrations_end_with(
    database_url: str, new_database: Callable[[str], str], databases: Callable[[str], Database]
) -> None:
    created = databases(database_url)
    migrated = databases(new_database(created.engine.dialect.name))
    migrated.migrate(REVISIONS[-1])
    for database in (created, migrated):
        database.migrate()
        assert database.versions() == (newest_revision(), newest_revision())
    assert described(created) == described(migrated)


def statements(database: Database) -> int:
    """How many statements a migration takes."""
    executed: list[object] = []
    event.listen(database.engine, "before_cursor_execute", lambda *_: executed.append(_))
    database.migrate()
    return len(executed)


@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_whoever_is_killed_in_a_migration_leaves_the_schema_as_it_was(
    kind: str, new_database: Callable[[str], str], databases: Callable[[str], Database]
) -> None:
    first = REVISIONS[-1]
    trial, database = databases(new_database(kind)), databases(url := new_database(kind))
    trial.migrate(first)
    database.migrate(first)
    with database.engine.begin() as connection:
        fill(connection)
    total = statements(trial)
    for survived in (total // 3, 2 * total // 3, total - 1):
        killed = subprocess.run([sys.executable, "-c", KILLED, url, str(survived)], cwd=ROOT)
        assert killed.returncode == -signal.SIGKILL
        assert database.versions()[0] == first
    database.migrate()
    with database.read() as transaction:
        assert len(transaction.scalars(select(SessionRow)).all()) == 1


def test_devices_of_earlier_recordings_are_known(database_url: str, databases: Callable[[str], Database]) -> None:
    database = databases(database_url)
    database.migrate("0001")
    times = [datetime(2026, 1, day, tzinfo=UTC) for day in (1, 2, 3)]
    hello = b'{"type": "hello", "recording": "r", "device": {"id": "%s", "kind": "phone"}}'
    with database.engine.begin() as connection:
        tables = reflected(connection).tables
        connection.execute(tables["sessions"].insert(), {"id": "s", "name": "", "created": times[0]})
        row = {"session_id": "s", "made_session": False, "next_seq": 0, "bytes": 0}
        for key, (device, time) in enumerate(zip((b"a", b"b", b"a"), times, strict=True), 1):
            more = {"key": key, "id": str(key), "hello": hello % device, "created": time}
            connection.execute(tables["recordings"].insert(), row | more)
    database.migrate()
    with database.read() as transaction:
        known = {d.id: (d.kind, d.first_seen, d.last_seen) for d in list_devices(transaction)}
    assert known == {"a": ("phone", times[0], times[2]), "b": ("phone", times[1], times[1])}
