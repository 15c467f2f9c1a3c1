"""Servers on one PostgreSQL hear of one another; on SQLite there is nobody."""

import queue
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from tests.conftest import PostgreSql
from tracemesh.storage.database import Database
from tracemesh.storage.exchange import Exchange, News, post
from tracemesh.storage.models import new_id


class Server:
    """What one server hears, and how often it may have missed something."""

    def __init__(self, url: str) -> None:
        self.name = new_id()
        self.database = Database(url)
        self.heard: queue.SimpleQueue[News] = queue.SimpleQueue()
        self.missed: queue.SimpleQueue[None] = queue.SimpleQueue()
        self.exchange = Exchange(self.database, self.name, self.heard.put, lambda: self.missed.put(None))

    def close(self) -> None:
        self.exchange.close()
        self.database.close()


@pytest.fixture
def servers(new_database: Callable[[str], str]) -> Iterator[list[Server]]:
    """Two that listen."""
    url = new_database("postgresql")
    with ExitStack() as stack:
        both = [Server(url) for _ in range(2)]
        for server in both:
            stack.callback(server.close)
            server.missed.get(timeout=30)
        yield both


NEWS = [News("recorded", "s" * 64, str(2**62), number) for number in range(100)]


def test_others_hear_everything_in_order_and_oneself_nothing(servers: list[Server]) -> None:
    servers[0].exchange.post(*NEWS)
    assert [servers[1].heard.get(timeout=30) for _ in NEWS] == NEWS
    servers[1].exchange.post(NEWS[7])
    assert servers[0].heard.get(timeout=30) == NEWS[7], "nothing of its own before"


def test_news_are_told_only_once_what_they_tell_of_is_committed(servers: list[Server]) -> None:
    with pytest.raises(ZeroDivisionError), servers[0].database.write() as transaction:
        post(transaction, servers[0].name, NEWS)
        raise ZeroDivisionError
    with servers[0].database.write() as transaction:
        post(transaction, servers[0].name, NEWS[3:4])
    assert servers[1].heard.get(timeout=30) == NEWS[3]


@pytest.mark.usefixtures("torn_connections")
def test_whoever_could_not_listen_knows_that_it_may_have_missed_something(
    servers: list[Server], postgresql: PostgreSql
) -> None:
    postgresql.crash()
    for server in servers:
        server.missed.get(timeout=60)
    servers[0].exchange.post(NEWS[0])
    assert servers[1].heard.get(timeout=30) == NEWS[0]


def test_on_sqlite_nothing_is_told(new_database: Callable[[str], str]) -> None:
    server = Server(new_database("sqlite"))
    server.exchange.post(*NEWS)
    with server.database.write() as transaction:
        post(transaction, server.name, NEWS)
    server.close()
    assert server.heard.empty()
    assert server.missed.empty()
