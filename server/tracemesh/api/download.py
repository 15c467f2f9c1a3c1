"""Files, or parts of them, whose refusals are problems like any other."""

from fastapi.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send

from tracemesh.api.errors import problem

REFUSED = {
    400: "the Range header is malformed: wanted bytes=FIRST-LAST, bytes=FIRST- or bytes=-COUNT",
    416: "the file ends before the range begins: Content-Range says how long it is",
}


class Download(FileResponse):
    """A file that knows Range and If-Range."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Starlette refuses a range in plain text, and nowhere lets others do it: what it sends is heard first."""
        refused: list[Message] = []

        async def listen(message: Message) -> None:
            if message.get("status") in REFUSED:
                refused.append(message)
            if not refused:
                await send(message)

        await super().__call__(scope, receive, listen)
        for start in refused:
            answer = problem(start["status"], REFUSED[start["status"]], scope["path"])
            answer.raw_headers += [header for header in start["headers"] if header[0] == b"content-range"]
            await answer(scope, receive, send)
