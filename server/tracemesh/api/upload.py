"""Files taken in as if a device had sent them, through the same recorder."""

from dataclasses import dataclass

from starlette.requests import Request

from tracemesh.api.recorder import Recorder
from tracemesh.errors import InputError, NotFound, Refused
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import read_recording, recording_from_scan, write_recording
from tracemesh.formats.scans import is_recording
from tracemesh.storage.states import RecordingState, SessionState
from tracemesh.wire.device import Hello, Recorded

CHUNK = 500
"""Messages between two waits for the disk."""


def file_body(*media_types: str) -> dict[str, object]:
    """What OpenAPI is told of a route whose body is a file as it is."""
    content = {media_type: {"schema": {"type": "string", "format": "binary"}} for media_type in media_types}
    return {"requestBody": {"required": True, "content": content}}


async def read_body(request: Request, limit: int) -> bytes:
    """A file that is the body of a request; raises InputError when it has more than `limit` bytes."""
    content = bytearray()
    async for chunk in request.stream():
        content += chunk
        if len(content) > limit:
            raise InputError(f"wanted a file of at most {limit} bytes")
    return bytes(content)


def utf8(content: bytes) -> str:
    """Text of a file; raises InputError with the place of the first byte that is none."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"wanted UTF-8 text, got byte 0x{content[error.start]:02x} at {error.start}") from None


@dataclass(frozen=True)
class Upload:
    """A recording and its messages, read and byte for byte."""

    hello: Hello
    payload: bytes
    messages: list[tuple[Recorded, bytes]]


def parse_upload(content: bytes, session: str, name: str) -> Upload:
    """A rawnet, to be recorded under `name`, or a recording, which has one; raises InputError with the line."""
    text = utf8(content)
    if not is_recording(text):
        text = write_recording(recording_from_scan(read_rawnet(text), name, session))
    lines = [line for line in text.split("\n") if line.strip()]
    recording = read_recording(lines)
    hello = recording.hello.model_copy(update={"session": session})
    payloads = [line.rstrip("\r").encode() for line in lines]
    upload = Upload(hello, payloads[0], list(zip(recording.messages, payloads[1:], strict=True)))
    _rehearse(upload)
    return upload


def _rehearse(upload: Upload) -> None:
    """Refuse a file that contradicts itself before any of it is stored."""
    state = RecordingState(0, SessionState("", 0, 0, 0), upload.hello, 0, 0, 0)
    for message, payload in upload.messages:
        try:
            state.check(message)
        except Refused as error:
            raise InputError(str(error)) from None
        state.advance(message, len(payload))


class _Uploader:
    """The recorder's view of an upload."""

    def __init__(self) -> None:
        self.failure: Refused | None = None

    def acknowledge(self, seq: int) -> None:
        pass

    def fail(self, reason: Refused) -> None:
        self.failure = reason


async def store_upload(recorder: Recorder, upload: Upload) -> None:
    """Store what is not stored yet of an upload, durably. Raises NotFound for an unknown session, or Refused."""
    sender = _Uploader()
    try:
        state = await recorder.open(upload.hello, upload.payload, sender)
    except Refused as error:
        raise (NotFound(str(error)) if error.code == "unknown" else error) from None
    try:
        for count, (message, payload) in enumerate(upload.messages, 1):
            recorder.accept(state, message, payload)
            if count % CHUNK == 0:
                await recorder.flush()
        await recorder.flush()
    except Refused as error:
        raise sender.failure or error from None
    finally:
        await recorder.leave(state, sender)
    if sender.failure is not None:
        raise sender.failure
