"""The database: schema, transactions, durability settings."""

import threading
from typing import Any

import pytest
from sqlalchemy import event, inspect, select, text

from tracemesh.storage.database import Database, newest_revision
from tracemesh.storage.models import Base, SessionRow
from tracemesh.storage.sessions import create_session, list_sessions
from tracemesh.wire.resources import SessionCreate


def test_migrating_again_keeps_everything(database: Database) -> None:
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="kept"))
    database.migrate()
    with database.read() as transaction:
        assert [s.id for s in list_sessions(transaction, 10)] == ["kept"]


def test_two_servers_may_migrate_at_once(database_url: str) -> None:
    databases = [Database(database_url) for _ in range(3)]
    threads = [threading.Thread(target=d.migrate) for d in databases]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    tables = inspect(databases[0].engine).get_table_names()
    for database in databases:
        database.close()
    assert {*Base.metadata.tables, "alembic_version"} == set(tables)


@pytest.mark.parametrize("revision", [None, newest_revision()], ids=["made at once", "by migrations"])
def test_a_schema_that_fails_leaves_nothing(database_url: str, revision: str | None) -> None:
    database = Database(database_url)

    def fail(_connection: Any, _cursor: Any, statement: str, *_more: Any) -> None:
        if "CREATE TABLE curves" in statement:
            raise RuntimeError("in the middle")

    event.listen(database.engine, "before_cursor_execute", fail)
    with pytest.raises(RuntimeError, match="in the middle"):
        database.migrate(revision)
    event.remove(database.engine, "before_cursor_execute", fail)
    assert inspect(database.engine).get_table_names() == []
    database.migrate(revision)
    assert "curves" in inspect(database.engine).get_table_names()
    database.close()


def test_a_failed_write_leaves_nothing(database: Database) -> None:
    with pytest.raises(RuntimeError), database.write() as transaction:
        transaction.add(SessionRow(id="ghost"))
        transaction.flush()
        raise RuntimeError
    with database.read() as transaction:
        assert transaction.scalar(select(SessionRow)) is None


def test_writers_wait_for_each_other(database: Database) -> None:
    """Ten threads read and then write in one transaction each: none fails, none is lost."""

    def add(number: int) -> None:
        with database.write() as transaction:
            transaction.scalars(select(SessionRow)).all()
            transaction.add(SessionRow(id=f"s{number}"))

    threads = [threading.Thread(target=add, args=(i,)) for i in range(10)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with database.read() as transaction:
        assert len(transaction.scalars(select(SessionRow)).all()) == 10


def test_sqlite_is_durable_and_keeps_references(tmp_path: object) -> None:
    database = Database(f"sqlite:///{tmp_path}/new/folder/x.db")
    with database.engine.connect() as connection:
        assert connection.execute(text("PRAGMA journal_mode")).scalar() == "wal"
        assert connection.execute(text("PRAGMA synchronous")).scalar() == 2
        assert connection.execute(text("PRAGMA foreign_keys")).scalar() == 1
    database.close()
