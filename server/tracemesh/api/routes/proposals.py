"""What was found in a session's curves, for a person to act on: nodes that nobody marked, and problems."""

from fastapi import APIRouter

from tracemesh.api.services import UseServices
from tracemesh.wire.base import Identifier
from tracemesh.wire.resources import NetworkProblems, NodeProposals

router = APIRouter(tags=["curves"])


@router.get("/sessions/{session}/node-proposals")
async def propose(session: Identifier, services: UseServices) -> NodeProposals:
    """Where curves seem to meet, with a confidence for each; nothing is marked by asking."""
    return await services.previewer.propose(session)


@router.get("/sessions/{session}/problems")
async def problems(session: Identifier, services: UseServices) -> NetworkProblems:
    """What keeps its curves from becoming a surface: where it is and, where there is one, the edit that mends it."""
    return await services.previewer.problems(session)
