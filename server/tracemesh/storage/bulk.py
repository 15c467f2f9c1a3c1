"""Many rows written by one statement.

For a list of rows pg8000 makes a round trip for each, and Python's SQLite gives up the interpreter's lock and has to
get it back for each, while a loop that serves devices wants it, too.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import chain
from typing import Any

from sqlalchemy import ARRAY, ColumnElement, Connection, Select, Table, bindparam, func, insert, inspect, select, update
from sqlalchemy.orm import InstrumentedAttribute

from tracemesh.storage.models import Base

Row = Mapping[str, Any]
AT_ONCE = 100
"""Rows of one INSERT: PostgreSQL takes arrays of less than 1 GiB, and a message has up to 4 MiB, as hexadecimals."""
MOST_VALUES = 128
"""Rows of one of SQLite's statements; a power of two, as are all of them: their texts are few, and stay prepared."""


def insert_all(connection: Connection, model: type[Base], rows: Sequence[Row]) -> None:
    """Insert rows that name every column which has no default in the database; values as its driver takes them."""
    if not rows:
        return
    table = _table(model)
    if connection.dialect.name == "postgresql":
        columns = {name: table.c[name] for name in rows[0]}
        for first in range(0, len(rows), AT_ONCE):
            some = _unnested(columns, rows[first : first + AT_ONCE])
            connection.execute(insert(table).from_select(list(columns), some, include_defaults=False))
    else:
        into = ", ".join(f'"{table.c[name].name}"' for name in rows[0])
        _each_with_values(connection, f"INSERT INTO {table.name} ({into}) {{values}}", rows)


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
        return _each_with_values(connection, _update_from_values(table, keys, columns), rows)
    new = _unnested(columns, rows).subquery("new")
    every = update(table).where(*(column == new.c[name] for name, column in keys.items()))
    return connection.execute(every.values({name: new.c[name] for name in columns if name not in keys})).rowcount


def _update_from_values(table: Table, keys: Mapping[str, Any], columns: Mapping[str, ColumnElement[Any]]) -> str:
    new = {name: (column.name, f"new.column{number}") for number, (name, column) in enumerate(columns.items(), 1)}
    others = ", ".join(f'"{column}" = {value}' for name, (column, value) in new.items() if name not in keys)
    same = " AND ".join(f'{table.name}."{column}" = {value}' for column, value in (new[name] for name in keys))
    return f"UPDATE {table.name} SET {others} FROM ({{values}}) AS new WHERE {same}"


def _each_with_values(connection: Connection, statement: str, rows: Sequence[Row]) -> int:
    """Number of rows that SQLite changed."""
    changed = 0
    for some in _powers_of_two(rows):
        text = statement.format(values=_values(len(some), len(rows[0])))
        changed += connection.exec_driver_sql(text, tuple(chain.from_iterable(row.values() for row in some))).rowcount
    return changed


def _powers_of_two(rows: Sequence[Row]) -> Iterator[Sequence[Row]]:
    first = 0
    while left := len(rows) - first:
        size = min(MOST_VALUES, 1 << left.bit_length() - 1)
        yield rows[first : first + size]
        first += size


@lru_cache
def _values(rows: int, columns: int) -> str:
    row = ", ".join("?" * columns)
    return "VALUES " + ", ".join([f"({row})"] * rows)


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
