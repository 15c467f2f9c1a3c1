"""PostgreSQL through pg8000: a broken connection is the database's fault, wherever the socket reports it.

pg8000 lets a socket's OSError out while it waits for an answer; SQLAlchemy takes only the driver's own errors for
faults of the database, so that callers would have to know of both.
"""

from typing import Any

from sqlalchemy import Engine, create_engine, event
from sqlalchemy.engine import URL, Dialect, ExceptionContext
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import InvalidatePoolError, OperationalError
from sqlalchemy.pool import ConnectionPoolEntry

from tracemesh.errors import ResourceError


def postgresql_engine(url: URL) -> Engine:
    """An engine that hands out living connections only, and raises SQLAlchemyError alone.

    Raises ResourceError when the driver is not installed.
    """
    try:
        engine = create_engine(url)
    except ImportError:
        raise ResourceError("PostgreSQL wants another package: pip install 'tracemesh[postgres]'") from None
    event.listen(engine, "do_connect", _connect)
    event.listen(engine, "checkout", lambda connection, _record, _pooled: _check(connection, engine.dialect))
    event.listen(engine, "handle_error", _take_for_a_disconnection)
    return engine


def _connect(dialect: Dialect, _record: ConnectionPoolEntry, arguments: Any, options: Any) -> DBAPIConnection:
    try:
        return dialect.connect(*arguments, **options)
    except OSError as error:
        raise dialect.loaded_dbapi.InterfaceError(f"no connection: {error}") from error


def _check(connection: DBAPIConnection, dialect: Dialect) -> None:
    """Its pool opens others instead of connections that were lost while they lay there."""
    try:
        dialect.do_ping(connection)
    except (OSError, dialect.loaded_dbapi.Error) as error:
        raise InvalidatePoolError(str(error)) from error


def _take_for_a_disconnection(context: ExceptionContext) -> Exception | None:
    fault = context.original_exception
    if not isinstance(fault, OSError):
        return None
    context.is_disconnect = True
    return OperationalError(context.statement, None, fault, connection_invalidated=True)
