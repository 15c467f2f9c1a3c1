"""What the routes use, made once per application."""

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Header
from sqlalchemy.orm import Session as Transaction
from starlette.requests import HTTPConnection

from tracemesh.api.access.roles import Principal
from tracemesh.api.access.tokens import Tokens
from tracemesh.api.comparing import Comparer
from tracemesh.api.live.hub import Hub
from tracemesh.api.metrics import Metrics
from tracemesh.api.preview import Previewer
from tracemesh.api.recorder import Recorder
from tracemesh.jobs.runner import JobRunner
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import ArtifactStore
from tracemesh.storage.database import Database
from tracemesh.storage.exchange import Exchange, News
from tracemesh.wire.resources import Reconstruction


@dataclass(frozen=True)
class Services:
    """Everything that lives as long as the application."""

    settings: Settings
    database: Database
    artifacts: ArtifactStore
    recorder: Recorder
    hub: Hub
    previewer: Previewer
    comparer: Comparer
    metrics: Metrics
    runner: JobRunner
    exchange: Exchange
    loop: asyncio.AbstractEventLoop
    tokens: Tokens

    def progressed(self, reconstruction: Reconstruction) -> None:
        """A reconstruction changed; from any thread."""
        self.loop.call_soon_threadsafe(self.hub.progressed, reconstruction)
        self.exchange.post(News("progressed", reconstruction.session, reconstruction.id))

    def edited(self, session: str) -> None:
        """Curves or marks of a session were edited; from any thread."""
        self.exchange.post(News("edited", session))
        self.loop.call_soon_threadsafe(self.previewer.forget, session)
        self.loop.call_soon_threadsafe(self.hub.edited, session)


def services(connection: HTTPConnection) -> Services:
    """The application's services."""
    found = connection.app.state.services
    assert isinstance(found, Services)
    return found


def principal(connection: HTTPConnection) -> Principal:
    """Who asks, as the gate found."""
    found = connection.scope["principal"]
    assert isinstance(found, Principal)
    return found


UseServices = Annotated[Services, Depends(services)]
UsePrincipal = Annotated[Principal, Depends(principal)]


def reading(services: UseServices) -> Iterator[Transaction]:
    """A transaction that only reads."""
    with services.database.read() as transaction:
        yield transaction


def writing(services: UseServices) -> Iterator[Transaction]:
    """A transaction, committed before the answer is sent."""
    with services.database.write() as transaction:
        yield transaction


IdempotencyKey = Annotated[
    str | None,
    Header(min_length=1, max_length=200, description="the same key again gives what the first request made"),
]
Reading = Annotated[Transaction, Depends(reading)]
Writing = Annotated[Transaction, Depends(writing, scope="function")]
