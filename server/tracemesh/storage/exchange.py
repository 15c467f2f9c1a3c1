"""News between servers that share a PostgreSQL: what one committed, the others hear of, and read for themselves.

LISTEN and NOTIFY carry names and numbers only. A server alone on SQLite has nobody to tell.
"""

import json
import logging
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import islice
from select import select as wait_for
from typing import Any, Literal, NamedTuple

from sqlalchemy import func, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session as Transaction

from tracemesh.storage.database import Database

CHANNEL = "tracemesh"
NEWS_AT_ONCE = 40
"""One notification holds less than 8000 bytes, one piece of news less than 200."""
LOOK = 0.25
"""s between two looks for news that the system did not tell of."""
AGAIN = 1.0
"""s between two attempts to reach a database that is away."""
log = logging.getLogger(__name__)


class News(NamedTuple):
    """Something happened in a session.

    recorded: the recording whose key is `subject` has more messages, the next curve has index `number`;
    left: the device of the recording `subject` is gone; edited: curves, marks or the session itself changed;
    progressed: the reconstruction `subject` changed.
    """

    kind: Literal["recorded", "left", "edited", "progressed"]
    session: str
    subject: str = ""
    number: int = 0


def post(transaction: Transaction, origin: str, news: Sequence[News]) -> None:
    """Tell all servers but `origin` once the transaction is committed."""
    if _is_shared(transaction.get_bind().dialect.name):
        remaining = iter(news)
        while some := list(islice(remaining, NEWS_AT_ONCE)):
            transaction.execute(select(func.pg_notify(CHANNEL, json.dumps([origin, some], separators=(",", ":")))))


class Exchange:
    """Posts and hears news on threads of its own; does nothing on SQLite."""

    def __init__(
        self, database: Database, origin: str, hear: Callable[[News], object], missed: Callable[[], object]
    ) -> None:
        """`hear` gets what others post; `missed` is called when there may have been news that nobody heard."""
        self._database = database
        self._origin = origin
        self._hear = hear
        self._missed = missed
        self._closing = threading.Event()
        self._poster = ThreadPoolExecutor(1, "news")
        self._thread = threading.Thread(target=self._listen, name="news listener")
        if self._is_needed:
            self._thread.start()

    def post(self, *news: News) -> None:
        """Tell the other servers soon; from any thread."""
        if self._is_needed and not self._closing.is_set():
            self._poster.submit(self._post, news)

    def close(self) -> None:
        """Post what was given, then stop."""
        self._closing.set()
        self._poster.shutdown()
        if self._is_needed:
            self._thread.join()

    @property
    def _is_needed(self) -> bool:
        return _is_shared(self._database.engine.dialect.name)

    def _post(self, news: Sequence[News]) -> None:
        try:
            with self._database.write() as transaction:
                post(transaction, self._origin, news)
        except SQLAlchemyError:
            log.warning("other servers could not be told of %s", news)

    def _listen(self) -> None:
        while not self._closing.is_set():
            try:
                with _line(self._database) as (connection, line):
                    self._missed()
                    while not self._closing.is_set():
                        wait_for([line], [], [], LOOK)
                        self._take(connection)
            except Exception as error:  # whatever a driver raises when its database is away
                log.warning("news of other servers cannot be heard now: %s", error)
                self._closing.wait(AGAIN)

    def _take(self, connection: Any) -> None:
        connection.cursor().execute("SELECT 1")
        heard = connection.notifications
        if len(heard) == heard.maxlen:
            self._missed()
        while heard:
            _, _, text = heard.popleft()
            origin, news = json.loads(text)
            for item in news if origin != self._origin else ():
                self._hear(News(*item))


def _is_shared(dialect: str) -> bool:
    return dialect == "postgresql"


@contextmanager
def _line(database: Database) -> Iterator[tuple[Any, socket.socket]]:
    """A connection that listens, and the socket on which its database speaks."""
    from pg8000 import dbapi  # an extra, present where the database is PostgreSQL

    _, options = database.engine.dialect.create_connect_args(database.engine.url)
    with socket.create_connection((options["host"], options.get("port") or 5432)) as line:
        connection = dbapi.connect(**options, sock=line)
        try:
            connection.autocommit = True
            connection.cursor().execute(f"LISTEN {CHANNEL}")
            yield connection, line
        finally:
            with suppress(Exception):  # it may be gone
                connection.close()
