"""Nodes that were found, for a person to accept or refuse."""

from fastapi import APIRouter

from tracemesh.api.services import UseServices
from tracemesh.wire.base import Identifier
from tracemesh.wire.resources import NodeProposals

router = APIRouter(tags=["curves"])


@router.get("/sessions/{session}/node-proposals")
async def propose(session: Identifier, services: UseServices) -> NodeProposals:
    """Where curves seem to meet, with a confidence for each; nothing is marked by asking."""
    return await services.previewer.propose(session)
