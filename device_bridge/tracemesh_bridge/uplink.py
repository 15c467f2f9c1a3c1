"""Sends a recording to a server, and goes on where the server stopped.

Every connection starts with `hello`; the server's `welcome` says which message it wants next. What it acknowledges is
deleted from the spool, nothing else ever is. A connection that breaks, stalls or is refused is opened again, later each
time. At most `WINDOW` messages are under way, so memory stays bounded however slow the server is.
"""

import asyncio
import random
from collections.abc import Coroutine
from pathlib import Path
from typing import Any, NoReturn, Protocol
from urllib.parse import urlsplit, urlunsplit

from pydantic import ValidationError
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException

from tracemesh.wire.base import PROTOCOL_VERSION
from tracemesh.wire.device import Ack, ErrorMessage, Hello, Welcome, to_device
from tracemesh_bridge.errors import BridgeError, Refused
from tracemesh_bridge.source import Link, LinkState

WINDOW = 256
OPEN_TIMEOUT = 10.0
STALE_AFTER = 5.0
"""s without an ack while messages are under way until the link is stale; after three times that it is reopened."""
PING_INTERVAL, PING_TIMEOUT = 5.0, 10.0
"""s between two questions whether the other side is there, and for which an answer is waited for."""
FIRST_DELAY, LONGEST_DELAY = 0.25, 15.0
_FINAL = ("version", "malformed", "forbidden", "unknown")
"""Errors that the same recording will meet again: tried again only after the longest delay, or not at all."""


class Lines(Protocol):
    """Reads a log from one message on."""

    seq: int

    def next(self) -> str | None:
        """The next message's line, or None if it may not be sent yet."""
        ...


class Log(Protocol):
    """What can be sent: a spool, or a recording in a file."""

    hello: Hello

    @property
    def first_seq(self) -> int:
        """Number of the oldest message still there."""
        ...

    @property
    def next_seq(self) -> int:
        """Number of the message that will come next."""
        ...

    @property
    def place(self) -> Path:
        """Where it is kept."""
        ...

    def lines(self, seq: int) -> Lines:
        """Its messages from `seq` on."""
        ...

    def acknowledge(self, seq: int) -> None:
        """The server has everything up to and including `seq`."""
        ...


class Uplink:
    """Uploads one log. Lives in one asyncio loop with whoever appends to it."""

    def __init__(self, server: str, token: str, log: Log, link: Link) -> None:
        """`server`: its address as a person types it, http, https, ws or wss; `token`: empty for none."""
        self._url = ingest_url(server)
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._log = log
        self._link = link
        self._changed = asyncio.Event()
        self._progress = asyncio.Event()
        self.acknowledged = log.first_seq
        """Number of messages that the server has."""
        self.session = ""
        self.refusal: Refused | None = None
        """Why the server does not want this recording, while it does not."""
        self._proposed: str | None = None

    def wake(self) -> None:
        """There is something new to send."""
        self._changed.set()

    async def run(self) -> None:
        """Keep sending until cancelled."""
        delay = FIRST_DELAY
        while True:
            before = self.acknowledged
            try:
                await self._admitted()
            except Refused as error:
                delay = LONGEST_DELAY
                self._link.down(str(error))
                self.refusal = error
                self._progress.set()
            except (OSError, TimeoutError, WebSocketException, BridgeError) as error:
                self._link.down(failure(error))
            if self.acknowledged > before:
                delay = FIRST_DELAY
            await asyncio.sleep(delay * random.uniform(0.5, 1.0))
            delay = min(2 * delay, LONGEST_DELAY)

    async def finished(self) -> None:
        """Wait until the server has everything that the log holds."""
        while self.acknowledged < self._log.next_seq:
            self._progress.clear()
            await self._progress.wait()

    async def finished_or_refused(self) -> None:
        """The same, for whoever does not wait for a server to change its mind. Raises Refused."""
        while self.refusal is None and self.acknowledged < self._log.next_seq:
            self._progress.clear()
            await self._progress.wait()
        if self.refusal is not None:
            raise self.refusal

    async def _admitted(self) -> None:
        try:
            await self._connection()
        except InvalidStatus as error:
            if error.response.status_code in (401, 403):
                raise Refused("the server wants a token, or another one: set TRACEMESH_TOKEN") from error
            raise

    async def _connection(self) -> None:
        self._link.to(LinkState.OPENING, self._url)
        async with connect(
            self._url, additional_headers=self._headers, compression=None, close_timeout=1,
            open_timeout=OPEN_TIMEOUT, ping_interval=PING_INTERVAL, ping_timeout=PING_TIMEOUT,
        ) as socket:  # fmt: skip
            async with asyncio.timeout(OPEN_TIMEOUT):
                await self._greet(socket)
            self._link.to(LinkState.LIVE, f"session {self.session} at {self._url}")
            try:
                await _first_to_fail(self._send(socket), self._receive(socket))
            except asyncio.CancelledError:
                await socket.close()  # on purpose, not because something failed: a normal closure
                raise

    async def _greet(self, socket: ClientConnection) -> None:
        await socket.send(self._log.hello.model_dump_json(exclude_none=True))
        welcome = _answer(await socket.recv())
        if isinstance(welcome, ErrorMessage):
            _raise(welcome)
        if not isinstance(welcome, Welcome):
            raise BridgeError(f"wanted welcome from the server, got {welcome.type}")
        if welcome.version != PROTOCOL_VERSION:
            raise Refused(
                f"the server speaks version {welcome.version} of the protocol, this bridge {PROTOCOL_VERSION}"
            )
        self.session = welcome.session
        self._resume(welcome.next_seq)
        self.refusal = None
        if welcome.calibration and welcome.calibration != self._proposed:
            self._proposed = welcome.calibration
            self._link.note(
                f"{welcome.calibration} is available; it is used only if you choose it on the session's page"
            )

    def _resume(self, next_seq: int) -> None:
        if next_seq < self._log.first_seq:
            raise Refused(
                f"the server wants message {next_seq} again, which it had acknowledged; "
                f"{self._log.place} begins at {self._log.first_seq}"
            )
        if next_seq > self._log.next_seq:
            raise Refused(
                f"the server has {next_seq} messages of recording {self._log.hello.recording}, "
                f"{self._log.place} only {self._log.next_seq}: it is an old copy; start with another --spool"
            )
        self._acknowledge(next_seq - 1)
        self._cursor = self._log.lines(next_seq)

    async def _send(self, socket: ClientConnection) -> NoReturn:
        while True:
            self._changed.clear()
            while self._cursor.seq - self.acknowledged < WINDOW and (line := self._cursor.next()) is not None:
                await socket.send(line)
            await self._changed.wait()

    async def _receive(self, socket: ClientConnection) -> NoReturn:
        silent = 0.0
        while True:
            try:
                async with asyncio.timeout(STALE_AFTER):
                    self._take(await socket.recv())
                silent = 0.0
            except TimeoutError:
                silent = self._silence(silent)

    def _take(self, data: str | bytes) -> None:
        message = _answer(data)
        if isinstance(message, ErrorMessage):
            _raise(message)
        if isinstance(message, Ack):
            if message.seq >= self._cursor.seq:
                raise BridgeError(f"the server acknowledged message {message.seq}, which was never sent")
            self._acknowledge(message.seq)
            self._link.to(LinkState.LIVE, "the server acknowledges again")

    def _silence(self, silent: float) -> float:
        if self.acknowledged >= self._cursor.seq:
            return 0.0
        silent += STALE_AFTER
        self._link.to(LinkState.STALE, f"no acknowledgement for {silent:.0f} s")
        if silent >= 3 * STALE_AFTER:
            raise BridgeError(f"the server acknowledged nothing for {silent:.0f} s")
        return silent

    def _acknowledge(self, seq: int) -> None:
        self.acknowledged = max(self.acknowledged, seq + 1)
        self._log.acknowledge(seq)
        self._changed.set()
        self._progress.set()


def ingest_url(server: str) -> str:
    """Where a server takes recordings. Raises BridgeError if the address is none."""
    try:
        parts = urlsplit(server if "//" in server else f"http://{server}")
        complete = bool(parts.hostname) and parts.port != 0  # a port that is none raises, too
    except ValueError:
        complete = False
    scheme = {"http": "ws", "https": "wss", "ws": "ws", "wss": "wss"}.get(parts.scheme) if complete else None
    if scheme is None:
        raise BridgeError(f"wanted a server's address such as http://127.0.0.1:8000, got {server!r}")
    path = parts.path.rstrip("/")
    return urlunsplit((scheme, parts.netloc, path if path.endswith("/ingest") else f"{path}/api/v1/ingest", "", ""))


async def _first_to_fail(*endless: Coroutine[Any, Any, NoReturn]) -> None:
    """Run coroutines that never return until one raises; the others are cancelled."""
    tasks = [asyncio.ensure_future(c) for c in endless]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_EXCEPTION)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _answer(data: str | bytes) -> Welcome | Ack | ErrorMessage:
    try:
        return to_device.validate_json(data)
    except ValidationError as error:
        raise BridgeError(f"wanted welcome, ack or error from the server, got {data[:80]!r}") from error


def _raise(error: ErrorMessage) -> NoReturn:
    raise (Refused if error.code in _FINAL else BridgeError)(f"the server says {error.code}: {error.message}")


def failure(error: BaseException) -> str:
    """Why a connection failed, for people."""
    match error:
        case InvalidStatus():
            return f"the server answered HTTP {error.response.status_code}"
        case ConnectionClosed():
            return "the connection broke"
        case TimeoutError():
            return "the server did not answer in time"
        case _:
            return str(error) or type(error).__name__
