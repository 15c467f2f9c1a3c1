"""Connections to PostgreSQL that break: at every moment one kind of error, and the next transaction works."""

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest
from sqlalchemy.engine import make_url
from sqlalchemy.exc import SQLAlchemyError

from tracemesh.storage.database import Database
from tracemesh.storage.models import SessionRow

pytestmark = pytest.mark.usefixtures("torn_connections")


class Line:
    """Stands between a client and a server and looks at what the client says; `cut` resets all connections."""

    def __init__(self, target: tuple[str, int]) -> None:
        self._target = target
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self._clients: list[socket.socket] = []
        self.look: Callable[[bytes], None] = lambda said: None
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listening.accept()
                self._clients.append(client)
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with socket.create_connection(self._target) as server, client:
            answers = threading.Thread(target=self._pass_on, args=(server, client, lambda said: None))
            answers.start()
            self._pass_on(client, server, lambda said: self.look(said))
            with suppress(OSError):
                server.shutdown(socket.SHUT_RDWR)
            answers.join()

    def _pass_on(self, source: socket.socket, sink: socket.socket, look: Callable[[bytes], None]) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                look(data)
                sink.sendall(data)

    def cut(self) -> None:
        cut, self._clients = self._clients, []  # not those that come in answer
        for client in cut:
            with suppress(OSError):
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                client.shutdown(socket.SHUT_RD)
            client.close()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)  # wakes who waits in accept
        self._listening.close()
        self.cut()


@pytest.fixture
def line(postgresql: Any) -> Iterator[Line]:
    url = make_url(postgresql.url)
    line = Line((url.host or "", url.port or 0))
    yield line
    line.close()


@pytest.fixture
def database(new_database: Callable[[str], str], line: Line) -> Iterator[Database]:
    direct = make_url(new_database("postgresql"))
    database = Database(direct.set(port=line.port).render_as_string(hide_password=False))
    database.migrate()
    yield database
    database.close()


def cut_at(line: Line, word: bytes) -> None:
    def cut(said: bytes) -> None:
        if word in said.lower():
            line.cut()

    line.look = cut


@pytest.mark.parametrize("word", [b"user", b"begin", b"insert", b"commit", b"rollback"])
def test_a_connection_that_breaks_is_the_databases_fault(database: Database, line: Line, word: bytes) -> None:
    """At the greeting, the first and the last word of a transaction, and between."""
    if word == b"user":
        database.close()
    cut_at(line, word)
    with pytest.raises((SQLAlchemyError, KeyError)), database.write() as transaction:
        transaction.add(SessionRow(id="a"))
        transaction.flush()
        if word == b"rollback":
            raise KeyError
    line.look = lambda said: None
    with database.write() as transaction:
        transaction.add(SessionRow(id="b"))
    with database.read() as transaction:
        assert transaction.get(SessionRow, "b")


def test_connections_that_broke_while_nobody_used_them_are_not_handed_out(database: Database, line: Line) -> None:
    for _ in range(3):
        line.cut()
        with database.read() as transaction:
            assert transaction.get(SessionRow, "nobody") is None
