"""Curves of a session: as sent, and as edited afterwards."""

from typing import Annotated

from fastapi import APIRouter, Path

from tracemesh.api.conditions import UseConditions
from tracemesh.api.paging import UsePage
from tracemesh.api.services import Reading, UseServices
from tracemesh.storage import curves
from tracemesh.storage.sessions import lock_session
from tracemesh.wire.base import Identifier
from tracemesh.wire.resources import Curve, CurveUpdate

router = APIRouter(prefix="/sessions/{session}/curves", tags=["curves"])
Index = Annotated[int, Path(ge=0, le=2**31 - 1)]


@router.get("")
def list_all(session: Identifier, transaction: Reading, page: UsePage) -> list[Curve]:
    """In the order of scanning, less those that were removed; the `Link` header names the next page."""
    found = curves.list_curves(transaction, session, page.limit, page.first)
    return page.of(found, lambda curve: curve.index)


@router.get("/{index}")
def get(session: Identifier, index: Index, transaction: Reading, conditions: UseConditions) -> Curve:
    """One curve."""
    return conditions.answer(curves.get_curve(transaction, session, index))


@router.patch("/{index}")
def update(
    session: Identifier, index: Index, change: CurveUpdate, services: UseServices, conditions: UseConditions
) -> Curve:
    """Change what the body names, with If-Match only what the sender has seen; samples stay as they were sent."""
    with services.database.write() as transaction:
        lock_session(transaction, session)
        conditions.demand(curves.get_curve(transaction, session, index))
        changed = curves.update_curve(transaction, session, index, change)
    services.edited(session)
    return conditions.answer(changed)
