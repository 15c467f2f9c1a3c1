"""Sessions as files: everything of one in one archive."""

import tempfile
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager

from fastapi import APIRouter, Request, Response
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from tracemesh.api.services import Services, UseServices
from tracemesh.api.upload import SPOOLED, chunks, file_body, parse_upload, spool_body, store_upload
from tracemesh.storage.archive import Manifest, read_archive, restore, write_archive
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
async def restore_session(request: Request, services: UseServices, response: Response) -> Session:
    """A new session from an archive: whole, or not at all."""
    with tempfile.SpooledTemporaryFile(SPOOLED) as file:
        await spool_body(request, services.settings.max_upload_bytes, file)
        manifest, contents = await run_in_threadpool(read_archive, file, services.settings.max_session_bytes)
    async with _new_session(services, manifest.name) as session:
        for name, content in contents.items():
            if name.startswith("recordings/"):
                upload = await run_in_threadpool(parse_upload, content, session, "")
                await store_upload(services.recorder, upload)
        await run_in_threadpool(_restore, services, session, manifest, contents)
    services.edited(session)
    response.headers["Location"] = f"/api/v1/sessions/{session}"
    return await run_in_threadpool(_get, services, session)


@asynccontextmanager
async def _new_session(services: Services, name: str) -> AsyncIterator[str]:
    """A session that is gone again if what is put into it fails."""

    def create() -> str:
        with services.database.write() as transaction:
            return create_session(transaction, SessionCreate(name=name)).id

    session = await run_in_threadpool(create)
    try:
        yield session
    except BaseException:
        await services.recorder.delete_session(session)
        raise


def _restore(services: Services, session: str, manifest: Manifest, contents: dict[str, bytes]) -> None:
    with services.database.write() as transaction:
        restore(transaction, services.artifacts, session, manifest, contents)


def _get(services: Services, session: str) -> Session:
    with services.database.read() as transaction:
        return get_session(transaction, session)
