"""Recordings of a session: everything that devices sent, byte for byte, and files that are taken in as if sent."""

from collections.abc import Iterator

from fastapi import APIRouter, Request, Response
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from tracemesh.api.paging import UsePage
from tracemesh.api.services import IdempotencyKey, Reading, Services, UseServices
from tracemesh.api.upload import file_body, parse_upload, read_body, store_upload
from tracemesh.storage import recordings
from tracemesh.storage.models import derived_id, new_id
from tracemesh.storage.recordings import recording_messages, recording_row
from tracemesh.wire.base import Identifier
from tracemesh.wire.resources import RecordingSummary, RecordingUpdate

router = APIRouter(prefix="/sessions/{session}/recordings", tags=["recordings"])


@router.get("")
def list_all(session: Identifier, transaction: Reading, page: UsePage) -> list[RecordingSummary]:
    """In the order in which they began; the `Link` header names the next page."""
    found = recordings.list_recordings(transaction, session, page.limit, page.after)
    return page.of(found, lambda recording: recording.id)


@router.get("/{recording}", response_class=StreamingResponse)
def export(session: Identifier, recording: Identifier, services: UseServices) -> StreamingResponse:
    """Newline-delimited JSON: `hello` and the numbered messages exactly as they were sent."""
    with services.database.read() as transaction:
        row = recording_row(transaction, session, recording)
    headers = {"Content-Disposition": f'attachment; filename="{recording}.ndjson"'}
    return StreamingResponse(_lines(services, row.key, row.hello), headers=headers, media_type="application/x-ndjson")


@router.patch("/{recording}")
def update(
    session: Identifier, recording: Identifier, change: RecordingUpdate, services: UseServices
) -> RecordingSummary:
    """Choose the calibration that corrects it from now on; what was sent stays as it is."""
    with services.database.write() as transaction:
        changed = recordings.update_recording(transaction, session, recording, change)
    services.edited(session)
    return changed


@router.post("", status_code=201, openapi_extra=file_body("text/plain", "application/x-ndjson"))
async def upload(
    session: Identifier,
    request: Request,
    services: UseServices,
    response: Response,
    idempotency_key: IdempotencyKey = None,
) -> RecordingSummary:
    """Take in a rawnet or a recording, told apart by their first character; a recording sent before is completed."""
    content = await read_body(request, services.settings.max_upload_bytes)
    name = f"file-{derived_id(idempotency_key, session) if idempotency_key else new_id()}"
    parsed = await run_in_threadpool(parse_upload, content, session, name)
    await store_upload(services.recorder, parsed)
    services.edited(session)
    response.headers["Location"] = f"/api/v1/sessions/{session}/recordings/{parsed.hello.recording}"
    return await run_in_threadpool(_summary, services, session, parsed.hello.recording)


def _summary(services: Services, session: str, recording: str) -> RecordingSummary:
    with services.database.read() as transaction:
        return recordings.summary(recording_row(transaction, session, recording))


def _lines(services: Services, key: int, hello: bytes) -> Iterator[bytes]:
    yield hello + b"\n"
    with services.database.read() as transaction:
        for payload in recording_messages(transaction, key):
            yield payload + b"\n"
