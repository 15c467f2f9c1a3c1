"""What compression changes about an answer besides its length."""

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class WeakTags:
    """A compressed answer has other bytes: its ETag must not promise the same ones to a later request for a range."""

    def __init__(self, app: ASGIApp) -> None:
        """To stand in front of the compression."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Weaken the ETag of compressed answers."""

        async def weaken(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(raw=message["headers"])
                if "content-encoding" in headers and headers.get("etag", "").startswith('"'):
                    headers["etag"] = f"W/{headers['etag']}"
            await send(message)

        await self._app(scope, receive, weaken)
