"""Batches: many scans or networks in one file, reconstructed after everything that somebody waits for."""

import re
import tempfile
import zipfile
from contextlib import ExitStack
from pathlib import PurePosixPath
from typing import IO, Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool

from tracemesh.api.conditions import UseConditions
from tracemesh.api.errors import validation_problems
from tracemesh.api.paging import UsePage
from tracemesh.api.services import IdempotencyKey, Reading, Services, UseServices
from tracemesh.api.upload import SPOOLED, chunks, file_body, parse_upload, spool_body, store_network, store_upload, utf8
from tracemesh.errors import InputError, TracemeshError
from tracemesh.formats.networks import read_network
from tracemesh.storage import batches
from tracemesh.storage.models import derived_id, new_id
from tracemesh.storage.reconstructions import create_reconstruction, list_reconstructions
from tracemesh.storage.sessions import create_session
from tracemesh.wire.base import Identifier, Name
from tracemesh.wire.resources import Batch, JobState, Reconstruction, ReconstructionParameters, SessionCreate

PARAMETERS = "parameters.json"
NETWORK = ".network.json"
MOST_SCANS = 10_000
SCAN_NAME = re.compile(r"[^\x00-\x1f\x7f]+")
router = APIRouter(prefix="/batches", tags=["batches"])


@router.post("", status_code=202, openapi_extra=file_body("application/zip"))
async def create(
    request: Request,
    services: UseServices,
    response: Response,
    name: Annotated[Name, Query(description="for people")] = "",
    idempotency_key: IdempotencyKey = None,
) -> Batch:
    """Take in a zip of rawnets, recordings and networks (`*.network.json`); each gets a session and a reconstruction.

    `parameters.json` in it, if any, holds the parameters of all. Nothing is stored unless everything can be read.
    """
    with tempfile.SpooledTemporaryFile(SPOOLED) as file:
        await spool_body(request, services.settings.max_upload_bytes, file)
        names, parameters = await run_in_threadpool(_checked, file, services.settings.max_session_bytes)
        batch = derived_id(idempotency_key, "batch") if idempotency_key else new_id()
        await run_in_threadpool(_begin, services, batch, name, len(names))
        for number, entry in enumerate(names):
            content = await run_in_threadpool(_read, file, entry)
            await _take_in(services, batch, number, entry, content, parameters)
    services.runner.wake()
    response.headers["Location"] = f"/api/v1/batches/{batch}"
    return await run_in_threadpool(_get, services, batch)


@router.get("")
def list_all(transaction: Reading, page: UsePage) -> list[Batch]:
    """Newest first; the `Link` header names the next page, when there is one."""
    return page.of(batches.list_batches(transaction, page.limit, page.after), lambda batch: batch.id)


@router.get("/{batch}")
def get(batch: Identifier, transaction: Reading, conditions: UseConditions) -> Batch:
    """One batch, with how far it is."""
    return conditions.answer(batches.get_batch(transaction, batch))


@router.get("/{batch}/reconstructions")
def jobs(batch: Identifier, transaction: Reading, page: UsePage, state: JobState | None = None) -> list[Reconstruction]:
    """Its reconstructions, newest first, all or those in one state."""
    batches.get_batch(transaction, batch)
    found = list_reconstructions(transaction, page.limit, page.after, batch=batch, state=state)
    return page.of(found, lambda job: job.id)


@router.get("/{batch}/results", response_class=StreamingResponse)
def results(batch: Identifier, services: UseServices) -> StreamingResponse:
    """The files of everything that is done, as a zip with a folder for each scan."""
    with services.database.read() as transaction:
        found = batches.batch_results(transaction, batch)
    with ExitStack() as stack:
        file = stack.enter_context(tempfile.SpooledTemporaryFile(SPOOLED))
        archive = stack.enter_context(zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED))
        for session, scan, name, digest in found:
            archive.write(services.artifacts.path(digest), f"{_safe(scan)}-{session[:8]}/{name}")
        archive.close()
        stack.pop_all()  # closed when it was sent
    headers = {"Content-Disposition": f'attachment; filename="{batch}.zip"'}
    return StreamingResponse(chunks(file), headers=headers, media_type="application/zip")


@router.post("/{batch}/cancel", status_code=202)
def cancel(batch: Identifier, services: UseServices) -> Batch:
    """Stop what has not ended."""
    with services.database.write() as transaction:
        changed, stopped = batches.cancel_batch(transaction, batch)
    for reconstruction in stopped:
        services.progressed(reconstruction)
    return changed


def _checked(file: IO[bytes], most: int) -> tuple[list[str], ReconstructionParameters]:
    """Names of a zip's scans, and the parameters; raises InputError for the first thing that cannot be read."""
    try:
        with zipfile.ZipFile(file) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            if sum(entry.file_size for entry in entries) > most:
                raise InputError(f"wanted a zip of at most {most} bytes when unpacked")
            names = [entry.filename for entry in entries if entry.filename != PARAMETERS]
            if not 0 < len(names) <= MOST_SCANS or len(set(names)) < len(names):
                raise InputError(f"wanted 1 to {MOST_SCANS} files of different names, got {len(names)}")
            for name in names:
                _check(name, archive.read(name))
            found = PARAMETERS in archive.namelist()
            return names, _parameters(archive.read(PARAMETERS)) if found else ReconstructionParameters()
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:  # as zipfile raises them
        raise InputError(f"wanted a zip of scans: {error}") from None


def _check(name: str, content: bytes) -> None:
    if not SCAN_NAME.fullmatch(name):
        raise InputError(f"wanted names without control characters, got {name!r}")
    try:
        if name.endswith(NETWORK):
            read_network(utf8(content))
        else:
            parse_upload(content, "none-yet", "none-yet")
    except TracemeshError as error:
        raise InputError(f"{name}: {error}") from None


def _parameters(content: bytes) -> ReconstructionParameters:
    try:
        return ReconstructionParameters.model_validate_json(content)
    except ValidationError as error:
        first = validation_problems(error)[0]
        raise InputError(f"{PARAMETERS}: {first['where']}: {first['wanted']}, got {first['got']}") from None


def _scan_name(entry: str) -> str:
    return PurePosixPath(entry).name[:200]


def _safe(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]", "_", name)


def _begin(services: Services, batch: str, name: str, size: int) -> None:
    with services.database.write() as transaction:
        batches.create_batch(transaction, batch, name, size)


def _read(file: IO[bytes], entry: str) -> bytes:
    with zipfile.ZipFile(file) as archive:
        return archive.read(entry)


async def _take_in(
    services: Services, batch: str, number: int, entry: str, content: bytes, parameters: ReconstructionParameters
) -> None:
    """Store one scan and queue its reconstruction; what was stored before stays as it is."""
    identifier = derived_id(str(number), batch)

    def session() -> str:
        with services.database.write() as transaction:
            return create_session(transaction, SessionCreate(name=_scan_name(entry)), identifier).id

    def queue() -> None:
        with services.database.write() as transaction:
            create_reconstruction(transaction, identifier, parameters, identifier, batch)

    await run_in_threadpool(session)
    if entry.endswith(NETWORK):
        await run_in_threadpool(store_network, services, identifier, content, identifier, batch)
    else:
        upload = await run_in_threadpool(parse_upload, content, identifier, f"file-{identifier}")
        await store_upload(services.recorder, upload)
        await run_in_threadpool(queue)


def _get(services: Services, batch: str) -> Batch:
    with services.database.read() as transaction:
        return batches.get_batch(transaction, batch)
