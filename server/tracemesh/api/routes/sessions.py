"""Sessions: the objects being scanned."""

from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import PlainTextResponse

from tracemesh.api.conditions import UseConditions
from tracemesh.api.outline import outline
from tracemesh.api.paging import UsePage
from tracemesh.api.services import IdempotencyKey, Reading, UseServices, Writing
from tracemesh.storage import sessions
from tracemesh.storage.models import derived_id
from tracemesh.wire.base import Identifier, Name
from tracemesh.wire.resources import Outline, Session, SessionCreate, SessionUpdate

router = APIRouter(prefix="/sessions", tags=["sessions"])


@router.post("", status_code=201)
def create(
    wanted: SessionCreate, transaction: Writing, response: Response, idempotency_key: IdempotencyKey = None
) -> Session:
    """Begin a session; 409 when the identifier is taken."""
    made = sessions.create_session(transaction, wanted, idempotency_key and derived_id(idempotency_key, "session"))
    response.headers["Location"] = f"/api/v1/sessions/{made.id}"
    return made


@router.get("")
def list_all(
    transaction: Reading,
    page: UsePage,
    name: Annotated[Name, Query(description="only those whose name contains it")] = "",
) -> list[Session]:
    """Newest first; the `Link` header names the next page, when there is one."""
    return page.of(sessions.list_sessions(transaction, page.limit, page.after, name), lambda session: session.id)


@router.get("/{session}")
def get(session: Identifier, transaction: Reading, conditions: UseConditions) -> Session:
    """One session."""
    return conditions.answer(sessions.get_session(transaction, session))


@router.get("/{session}/outline")
def draw(session: Identifier, transaction: Reading, services: UseServices) -> Outline:
    """Its curves in few points: as reconstructed, else as reckoned from what was sent."""
    return outline(transaction, services.artifacts, session)


@router.get("/{session}/scan.rawnet", response_class=PlainTextResponse)
async def rawnet(session: Identifier, services: UseServices) -> PlainTextResponse:
    """Its curves as edited, with the frames that the readings give: for other programs."""
    headers = {"Content-Disposition": f'attachment; filename="{session}.rawnet"'}
    return PlainTextResponse(await services.previewer.rawnet(session), headers=headers)


@router.patch("/{session}")
def update(session: Identifier, change: SessionUpdate, transaction: Writing, conditions: UseConditions) -> Session:
    """Change what the body names; with If-Match only what the sender has seen."""
    sessions.lock_session(transaction, session)
    conditions.demand(sessions.get_session(transaction, session))
    return conditions.answer(sessions.update_session(transaction, session, change))


@router.delete("/{session}", status_code=204)
async def delete(session: Identifier, services: UseServices) -> None:
    """Delete a session with everything in it; devices that record into it are cut off, its tokens end."""
    await services.recorder.delete_session(session)
    services.edited(session)
    services.tokens.forget()
