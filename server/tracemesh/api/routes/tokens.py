"""Tokens: whom else the owner lets in."""

from fastapi import APIRouter, Response

from tracemesh.api.services import Reading, UsePrincipal, UseServices
from tracemesh.errors import NotFound
from tracemesh.storage import tokens
from tracemesh.wire.access import NewToken, Rights, Token, TokenCreate
from tracemesh.wire.base import Identifier

router = APIRouter(tags=["access"])


@router.get("/rights")
def rights(principal: UsePrincipal, services: UseServices) -> Rights:
    """What the bearer of this request's token may do."""
    return Rights(
        role=principal.role,
        session=principal.session,
        expires=principal.expires,
        closed=services.settings.closed,
    )


@router.post("/tokens", status_code=201)
def create(wanted: TokenCreate, principal: UsePrincipal, services: UseServices, response: Response) -> NewToken:
    """Let somebody in; the answer is the only one that holds the token. Who owns one session shares that one."""
    if principal.session not in (None, wanted.session):
        raise NotFound(f"wanted session {principal.session}: this token owns no other")
    with services.database.write() as transaction:
        made = tokens.create_token(transaction, wanted)
    response.headers["Location"] = f"/api/v1/tokens/{made.id}"
    response.headers["Cache-Control"] = "no-store"
    return made


@router.get("/tokens")
def list_all(principal: UsePrincipal, transaction: Reading, session: Identifier | None = None) -> list[Token]:
    """Tokens that are good, newest first; with `session`, those of that session alone."""
    return tokens.list_tokens(transaction, principal.session or session)


@router.delete("/tokens/{token}", status_code=204)
def revoke(token: Identifier, principal: UsePrincipal, services: UseServices) -> None:
    """Let its bearer in no more, and close the sockets that it opened."""
    with services.database.write() as transaction:
        tokens.revoke_token(transaction, token, principal.session)
    services.loop.call_soon_threadsafe(services.tokens.forget)
