"""Readings of fixed arrays: when they were taken, and the network of each."""

from typing import Annotated

from fastapi import APIRouter, Path, Query

from tracemesh.api.services import Reading, UseServices
from tracemesh.storage import readings
from tracemesh.wire.base import Identifier
from tracemesh.wire.live import LiveReading
from tracemesh.wire.resources import Readings

router = APIRouter(prefix="/sessions/{session}/readings", tags=["readings"])
Number = Annotated[int, Path(ge=0, le=2**53 - 1)]


@router.get("")
def list_all(
    session: Identifier,
    transaction: Reading,
    first: Annotated[int, Query(ge=0, le=2**53 - 1, description="number of the first reading wanted")] = 0,
    limit: Annotated[int, Query(ge=0, le=100_000)] = 10_000,
) -> Readings:
    """How many there are, and when they were taken."""
    return readings.list_readings(transaction, session, first, limit)


@router.get("/{number}")
async def network(session: Identifier, number: Number, services: UseServices) -> LiveReading:
    """The curve network of one reading."""
    return await services.previewer.reading(session, number)
