"""What a client may cost: the size of a body and the time that it, a request's head or an answer may take."""

import asyncio
import re
from math import inf
from time import monotonic

import h11
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from tracemesh.api.errors import problem

MAX_JSON = 8 * 2**20
"""Most bytes of a body that is not an uploaded file."""
UPLOAD = re.compile(r"/(recordings|networks|archive|comparison)$")
"""Routes that take files: they know themselves how large these may be."""
HEAD_TIMEOUT = 10.0
"""s in which a request's head has to come."""
STUCK_TIMEOUT = 60.0
"""s without room for more of an answer after which nobody reads it."""
GRACE, SLOWEST = 30.0, 1024
"""s that any body may take, and bytes a second that it has to bring after that."""


class PatientHttp(H11Protocol):
    """uvicorn waits for ever for the rest of a request's head, and for a client that does not read; this does not."""

    _alarm: asyncio.TimerHandle | None = None
    _stuck: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Expect a head."""
        super().connection_made(transport)
        self._expect_head()

    def data_received(self, data: bytes) -> None:
        """Whoever has sent a whole head has done enough; what begins another one has as long for it again."""
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            self._calm()
        elif self._alarm is None:
            self._expect_head()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """A socket has rules of its own."""
        self._calm()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nothing is expected any more."""
        self._calm()
        self.resume_writing()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """The client is behind with reading."""
        super().pause_writing()
        self._stuck = self.loop.call_later(STUCK_TIMEOUT, self.transport.abort)

    def resume_writing(self) -> None:
        """It reads on."""
        super().resume_writing()
        if self._stuck is not None:
            self._stuck.cancel()
            self._stuck = None

    def _expect_head(self) -> None:
        self._alarm = self.loop.call_later(HEAD_TIMEOUT, self.transport.abort)

    def _calm(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None


class BodyLimits:
    """ASGI middleware: no body is larger or slower than it has to be."""

    def __init__(self, app: ASGIApp) -> None:
        """To stand in front of the routes."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse what says that it is too large; stop what turns out to be so."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        limit = inf if UPLOAD.search(scope["path"]) else MAX_JSON
        declared = Headers(scope=scope).get("content-length", "0")
        if not declared.isascii() or not declared.isdigit() or int(declared[:20]) > limit:
            answer = problem(413, f"wanted a body of at most {limit} bytes, got {declared[:20]}", scope["path"])
            await answer(scope, receive, send)
            return
        await self._app(scope, _Body(receive, limit).receive, send)


class _Body:
    def __init__(self, receive: Receive, limit: float) -> None:
        self._receive = receive
        self._limit = limit
        self._begun = monotonic()
        self._received = 0
        self._complete = False

    async def receive(self) -> Message:
        if self._complete:
            return await self._receive()
        left = self._begun + GRACE + self._received / SLOWEST - monotonic()
        try:
            message = await asyncio.wait_for(self._receive(), max(left, 0.0))
        except TimeoutError:
            raise HTTPException(408, f"the body came too slowly: {self._received} bytes so far") from None
        self._received += len(message.get("body", b""))
        self._complete = not message.get("more_body", False)
        if self._received > self._limit:
            raise HTTPException(413, f"wanted a body of at most {self._limit} bytes")
        return message
