"""Reconstructions of a session, which are jobs, and the files that they leave."""

from typing import Annotated, Literal

from fastapi import APIRouter, Header, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from tracemesh.api.conditions import UseConditions
from tracemesh.api.download import Download
from tracemesh.api.paging import UsePage
from tracemesh.api.services import IdempotencyKey, Reading, Services, UseServices
from tracemesh.api.upload import file_body, read_body, store_network
from tracemesh.storage import reconstructions
from tracemesh.storage.artifacts import MEDIA_TYPES, artifact_row
from tracemesh.storage.models import derived_id
from tracemesh.wire.base import Identifier
from tracemesh.wire.live import Preview
from tracemesh.wire.resources import JobState, PreviewWish, Reconstruction, ReconstructionParameters

router = APIRouter(tags=["reconstructions"])


@router.post("/sessions/{session}/reconstructions", status_code=202)
def create(
    session: Identifier,
    services: UseServices,
    response: Response,
    parameters: ReconstructionParameters | None = None,
    idempotency_key: IdempotencyKey = None,
) -> Reconstruction:
    """Queue a reconstruction; follow it with GET or on the session's live socket."""
    with services.database.write() as transaction:
        derived = idempotency_key and derived_id(idempotency_key, session)
        wanted = parameters or ReconstructionParameters()
        made = reconstructions.create_reconstruction(transaction, session, wanted, derived)
    return _queued(services, response, made)


@router.post("/sessions/{session}/networks", status_code=202, openapi_extra=file_body("application/json"))
async def span(
    session: Identifier,
    request: Request,
    services: UseServices,
    response: Response,
    idempotency_key: IdempotencyKey = None,
) -> Reconstruction:
    """Take in a curve network that is known already (network JSON) and queue the surface that spans it."""
    content = await read_body(request, services.settings.max_upload_bytes)
    derived = idempotency_key and derived_id(idempotency_key, session, "network")
    made = await run_in_threadpool(store_network, services, session, content, derived)
    return _queued(services, response, made)


def _queued(services: Services, response: Response, made: Reconstruction) -> Reconstruction:
    services.runner.wake()
    services.progressed(made)
    response.headers["Location"] = f"/api/v1/reconstructions/{made.id}"
    return made


@router.post("/sessions/{session}/preview")
async def preview(
    session: Identifier,
    services: UseServices,
    wanted: PreviewWish | None = None,
    client: Annotated[str, Query(max_length=64, description="only its newest wish is answered")] = "",
) -> Preview:
    """The network with these parameters and marks, at once; 409 when the same client asked again meanwhile."""
    return await services.previewer.solve(session, client, wanted or PreviewWish())


@router.get("/sessions/{session}/reconstructions")
def list_all(
    session: Identifier, transaction: Reading, page: UsePage, state: JobState | None = None
) -> list[Reconstruction]:
    """Newest first, all or those in one state; the `Link` header names the next page, when there is one."""
    found = reconstructions.list_reconstructions(transaction, page.limit, page.after, session=session, state=state)
    return page.of(found, lambda job: job.id)


@router.get("/reconstructions/{reconstruction}")
def get(reconstruction: Identifier, transaction: Reading, conditions: UseConditions) -> Reconstruction:
    """One reconstruction, with its progress."""
    return conditions.answer(reconstructions.get_reconstruction(transaction, reconstruction))


@router.post("/reconstructions/{reconstruction}/cancel", status_code=202)
def cancel(reconstruction: Identifier, services: UseServices) -> Reconstruction:
    """Stop it: at once while it is queued, after its present stage when it runs; 409 when it has ended."""
    with services.database.write() as transaction:
        stopped = reconstructions.request_cancel(transaction, reconstruction)
    services.progressed(stopped)
    return stopped


@router.get("/reconstructions/{reconstruction}/{name}", response_class=Download)
def artifact(
    reconstruction: Identifier,
    name: Literal["network.json", "mesh.glb", "report.json"],
    transaction: Reading,
    services: UseServices,
    if_none_match: Annotated[str, Header()] = "",
) -> Response:
    """A file that it left; knows ETag, If-None-Match and Range."""
    row = artifact_row(transaction, reconstruction, name)
    headers = {"ETag": f'"{row.sha256}"', "Cache-Control": "private, no-cache"}
    if f'"{row.sha256}"' in if_none_match or if_none_match.strip() == "*":
        return Response(status_code=304, headers=headers)
    return Download(services.artifacts.path(row.sha256), headers=headers, media_type=MEDIA_TYPES[name])
