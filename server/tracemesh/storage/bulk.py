"""Many rows written at once: on PostgreSQL by one statement, as pg8000 makes a round trip for each row of a list."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import ARRAY, ColumnElement, Connection, Select, Table, bindparam, func, insert, inspect, select, update
from sqlalchemy.orm import InstrumentedAttribute

from tracemesh.storage.models import Base

Row = Mapping[str, Any]
AT_ONCE = 100
"""Rows of one INSERT: PostgreSQL takes arrays of less than 1 GiB, and a message has up to 4 MiB, as hexadecimals."""


def insert_all(connection: Connection, model: type[Base], rows: Sequence[Row]) -> None:
    """Insert rows that name every column which has no default in the database."""
    if not rows:
        return
    table = _table(model)
    if connection.dialect.name == "postgresql":
        columns = {name: table.c[name] for name in rows[0]}
        for first in range(0, len(rows), AT_ONCE):
            some = _unnested(columns, rows[first : first + AT_ONCE])
            connection.execute(insert(table).from_select(list(columns), some, include_defaults=False))
    else:
        connection.execute(insert(table), list(rows))


def update_each(
    connection: Connection, model: type[Base], where: Mapping[str, InstrumentedAttribute[Any]], rows: Sequence[Row]
) -> int:
    """Number of rows changed: of each row the stored one that has its values in the columns `where` gets the others.

    `where` gives the column to each of these names, which are no names of columns; no two rows are about the same one.
    """
    if not rows:
        return 0
    table = _table(model)
    keys = {name: table.c[attribute.key] for name, attribute in where.items()}
    columns = {name: keys[name] if name in keys else table.c[name] for name in rows[0]}
    if connection.dialect.name != "postgresql":
        one = update(table).where(*(column == bindparam(name) for name, column in keys.items()))
        return connection.execute(one, list(rows)).rowcount
    new = _unnested(columns, rows).subquery("new")
    every = update(table).where(*(column == new.c[name] for name, column in keys.items()))
    return connection.execute(every.values({name: new.c[name] for name in columns if name not in keys})).rowcount


def _table(model: type[Base]) -> Table:
    table = inspect(model).local_table
    assert isinstance(table, Table)
    return table


def _unnested(columns: Mapping[str, ColumnElement[Any]], rows: Sequence[Row]) -> Select[Any]:
    """The rows as an array for each column: the statement's text does not depend on how many there are."""
    arrays = {
        name: bindparam(None, [row[name] for row in rows], ARRAY(column.type)) for name, column in columns.items()
    }
    return select(*(func.unnest(array).label(name) for name, array in arrays.items()))
