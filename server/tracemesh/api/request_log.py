"""A line for every request, with an identifier that the client is told too."""

import logging
import re
from time import monotonic

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from tracemesh.logs import about
from tracemesh.storage.models import new_id

HEADER = "X-Request-ID"
KNOWN = re.compile(r"[A-Za-z0-9_.-]{1,64}")
log = logging.getLogger(__name__)


class RequestLog:
    """ASGI middleware. What stands in the address after `?` is never written down: a token may be among it."""

    def __init__(self, app: ASGIApp) -> None:
        """To stand in front of everything."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Name the request as its client or a proxy does, or anew; tell it; write a line when an API's is over."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        given = Headers(scope=scope).get(HEADER, "")
        request = given if KNOWN.fullmatch(given) else new_id()
        begun, status = monotonic(), 0

        async def tell(message: Message) -> None:
            nonlocal status
            if message["type"] in ("http.response.start", "websocket.accept"):
                status = message.get("status", 101)
                message.setdefault("headers", [])
                MutableHeaders(scope=message)[HEADER] = request
            await send(message)

        with about(request=request):
            try:
                await self._app(scope, receive, tell)
            finally:
                if scope["path"].startswith("/api/"):
                    self._write(scope, status, monotonic() - begun)

    @staticmethod
    def _write(scope: Scope, status: int, seconds: float) -> None:
        method, client = scope.get("method", "SOCKET"), scope["client"][0] if scope.get("client") else "-"
        log.info("%s %s %d in %.0f ms from %s", method, ascii(scope["path"])[1:-1], status, 1000 * seconds, client)
