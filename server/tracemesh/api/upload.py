"""Files taken in as if a device had sent them, through the same recorder."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from tracemesh.api.recorder import Recorder
from tracemesh.api.services import Services
from tracemesh.errors import InputError, NotFound, Refused
from tracemesh.formats.networks import read_network
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import read_recording, recording_from_scan, write_recording
from tracemesh.formats.scans import is_recording
from tracemesh.storage.reconstructions import create_reconstruction, give_artifact
from tracemesh.storage.states import RecordingState, SessionState
from tracemesh.wire.device import Hello, Recorded
from tracemesh.wire.resources import Reconstruction, ReconstructionParameters

CHUNK = 500
"""Messages between two waits for the disk."""
SPOOLED = 2**24
"""Bytes of a file that stay in memory; larger ones go to a temporary file."""


def file_body(*media_types: str) -> dict[str, object]:
    """What OpenAPI is told of a route whose body is a file as it is."""
    content = {media_type: {"schema": {"type": "string", "format": "binary"}} for media_type in media_types}
    return {"requestBody": {"required": True, "content": content}}


async def read_body(request: Request, limit: int) -> bytes:
    """A file that is the body of a request; raises InputError when it has more than `limit` bytes.

    As long as it is not whole it waits on disk: many slow senders cost no memory.
    """
    with tempfile.SpooledTemporaryFile(SPOOLED) as file:
        await spool_body(request, limit, file)
        file.seek(0)
        return await run_in_threadpool(file.read)


async def spool_body(request: Request, limit: int, file: IO[bytes]) -> None:
    """Write the body of a request to a file as it comes; raises InputError when it has more than `limit` bytes."""
    size = 0
    async for chunk in request.stream():
        size += len(chunk)
        if size > limit:
            raise InputError(f"wanted a file of at most {limit} bytes")
        await run_in_threadpool(file.write, chunk)


def chunks(file: IO[bytes]) -> Iterator[bytes]:
    """A file from its beginning, closed at the end."""
    with file:
        file.seek(0)
        while chunk := file.read(SPOOLED // 256):
            yield chunk


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


def store_network(
    services: Services, session: str, content: bytes, identifier: str | None = None, batch: str | None = None
) -> Reconstruction:
    """Queue the surface over a network that is known already; raises InputError, NotFound or Unavailable."""
    text = utf8(content)
    read_network(text)
    stored = text.encode()
    digest = services.artifacts.put(stored)
    with services.database.write() as transaction:
        made = create_reconstruction(transaction, session, ReconstructionParameters(), identifier, batch)
        return give_artifact(transaction, made.id, "network.json", digest, len(stored))
