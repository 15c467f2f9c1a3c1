"""Sessions as files: everything of one in one archive."""

import tempfile
from contextlib import ExitStack
from typing import IO

from fastapi import APIRouter, Request, Response
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from tracemesh.api.services import IdempotencyKey, UseServices
from tracemesh.api.upload import SPOOLED, chunks, file_body, parse_upload, spool_body
from tracemesh.storage.archive import RECORDINGS, read_archive, restore, write_archive
from tracemesh.storage.artifacts import ArtifactStore
from tracemesh.storage.database import Database
from tracemesh.storage.ingest import record
from tracemesh.storage.models import SessionRow, derived_id, new_id
from tracemesh.storage.sessions import create_session, get_session
from tracemesh.wire.base import Identifier
from tracemesh.wire.resources import Session, SessionCreate

router = APIRouter(prefix="/sessions", tags=["sessions"])


@router.get("/{session}/archive", response_class=StreamingResponse)
def export(session: Identifier, services: UseServices) -> StreamingResponse:
    """Recordings as sent, curves as edited, reconstructions that are done with their files, with checksums."""
    with ExitStack() as stack, services.database.read() as transaction:
        file = stack.enter_context(tempfile.SpooledTemporaryFile(SPOOLED))
        write_archive(transaction, services.artifacts, session, file)
        stack.pop_all()  # closed when it was sent
    headers = {"Content-Disposition": f'attachment; filename="{session}.tracemesh.zip"'}
    return StreamingResponse(chunks(file), headers=headers, media_type="application/zip")


@router.post("/archive", status_code=201, openapi_extra=file_body("application/zip"))
async def restore_session(
    request: Request, services: UseServices, response: Response, idempotency_key: IdempotencyKey = None
) -> Session:
    """A new session from an archive: whole, or not at all."""
    derived = idempotency_key and derived_id(idempotency_key, "archive")
    limit = services.settings.max_session_bytes
    with tempfile.SpooledTemporaryFile(SPOOLED) as file:
        await spool_body(request, services.settings.max_upload_bytes, file)
        made = await run_in_threadpool(restored, services.database, services.artifacts, file, limit, derived)
    services.edited(made.id)
    response.headers["Location"] = f"/api/v1/sessions/{made.id}"
    return made


def restored(
    database: Database, store: ArtifactStore, file: IO[bytes], max_bytes: int, derived: str | None = None
) -> Session:
    """The session that an archive becomes, in one transaction; or the one that is called `derived` already."""
    manifest, contents = read_archive(file, max_bytes)
    session = derived or new_id()
    uploads = [parse_upload(content, session, "") for name, content in contents.items() if name.startswith(RECORDINGS)]
    with database.write() as transaction:
        if derived is None or transaction.get(SessionRow, derived) is None:
            create_session(transaction, SessionCreate(id=session, name=manifest.name))
            for upload in uploads:
                record(transaction, upload.hello, upload.payload, upload.messages)
            restore(transaction, store, session, manifest, contents)
        return get_session(transaction, session)
