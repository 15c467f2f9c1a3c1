"""A reconstructed surface beside a true one."""

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from tracemesh.api.services import Services, UseServices
from tracemesh.api.upload import file_body, read_body
from tracemesh.errors import TracemeshError
from tracemesh.jobs.comparison import Truth
from tracemesh.storage.artifacts import artifact_row
from tracemesh.wire.base import Identifier
from tracemesh.wire.resources import Comparison, ComparisonFailure, ComparisonProgress

router = APIRouter(prefix="/reconstructions/{reconstruction}", tags=["reconstructions"])
LINES = {"application/x-ndjson": {"schema": {"type": "string"}}}


@router.post(
    "/comparison",
    response_class=StreamingResponse,
    openapi_extra=file_body("application/octet-stream"),
    responses={200: {"description": "a ComparisonProgress a line, then a Comparison", "content": LINES}},
)
async def compare(
    reconstruction: Identifier,
    request: Request,
    services: UseServices,
    truth: Annotated[str, Query(max_length=200, description="name of the file: .glb, .obj, .ply or .stl")],
    align: Annotated[
        Literal["none", "rigid", "similarity"], Query(description="register first; similarity also scales")
    ] = "rigid",
) -> StreamingResponse:
    """Distances to the true mesh in the body: lines of progress, then the result or a failure."""
    mesh = await run_in_threadpool(_mesh, services, reconstruction)
    content = await read_body(request, services.settings.max_upload_bytes)
    answers = services.comparer.compare(mesh, Truth(truth, content), align)
    first = await anext(answers)  # what is no mesh is refused before the answer begins
    return StreamingResponse(_lines(first, answers), media_type="application/x-ndjson")


def _mesh(services: Services, reconstruction: str) -> Path:
    with services.database.read() as transaction:
        return services.artifacts.path(artifact_row(transaction, reconstruction, "mesh.glb").sha256)


async def _lines(
    first: ComparisonProgress | Comparison, rest: AsyncIterator[ComparisonProgress | Comparison]
) -> AsyncIterator[str]:
    yield first.model_dump_json() + "\n"
    try:
        async for answer in rest:
            yield answer.model_dump_json() + "\n"
    except TracemeshError as error:
        yield ComparisonFailure(detail=str(error)).model_dump_json() + "\n"
