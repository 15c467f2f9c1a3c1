"""The application: nothing global, everything from its settings."""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any

from fastapi import APIRouter, FastAPI
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware

from tracemesh.api.access.gate import Gate
from tracemesh.api.access.tokens import Tokens
from tracemesh.api.comparing import Comparer
from tracemesh.api.compression import WeakTags
from tracemesh.api.described import DescribedApi
from tracemesh.api.errors import install_handlers
from tracemesh.api.limits import BodyLimits
from tracemesh.api.live.elsewhere import Elsewhere
from tracemesh.api.live.hub import Hub
from tracemesh.api.metrics import Metrics
from tracemesh.api.preview import Previewer
from tracemesh.api.recorder import Recorder
from tracemesh.api.request_log import RequestLog
from tracemesh.api.routes import (
    archives,
    batches,
    comparisons,
    curves,
    devices,
    ingest,
    live,
    networks,
    pages,
    proposals,
    readings,
    reconstructions,
    recordings,
    sessions,
    tokens,
)
from tracemesh.api.services import Services
from tracemesh.jobs.runner import JobRunner
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import ArtifactStore, open_artifacts
from tracemesh.storage.database import Database
from tracemesh.storage.exchange import Exchange, News
from tracemesh.storage.models import new_id
from tracemesh.storage.states import RecordingState
from tracemesh.wire.device import Recorded
from tracemesh.wire.resources import Problem, Reconstruction

log = logging.getLogger(__name__)
CHECKPOINT_INTERVAL = 1.0
"""s between two copies of SQLite's log into its main file."""
TIDY_INTERVAL = 3600.0
"""s between two searches for artifacts that nobody needs."""
ROUTES = (
    archives,
    batches,
    sessions,
    curves,
    recordings,
    readings,
    proposals,
    comparisons,
    reconstructions,
    devices,
    ingest,
    live,
    networks,
    tokens,
)
PROBLEMS: dict[int | str, dict[str, Any]] = {status: {"model": Problem} for status in (401, 403, 404, 409, 422)}


def create_app(settings: Settings) -> FastAPI:
    """The service with these settings; opens its database when it starts, commits and closes when it stops."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with running(settings) as services:
            app.state.services = services
            yield

    app = DescribedApi(
        title="tracemesh",
        version=version("tracemesh"),
        description="Curve networks and surfaces from orientations measured along curves.",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        swagger_ui_oauth2_redirect_url=None,
        middleware=[
            Middleware(RequestLog),
            Middleware(Gate, settings=settings),
            Middleware(BodyLimits),
            Middleware(WeakTags),
            Middleware(GZipMiddleware, compresslevel=4),
        ],
    )
    install_handlers(app)
    api = APIRouter(prefix="/api/v1", responses=PROBLEMS)
    for module in ROUTES:
        api.include_router(module.router)
    app.include_router(api)
    app.include_router(pages.router)
    pages.mount_web(app)
    return app


@asynccontextmanager
async def running(settings: Settings) -> AsyncIterator[Services]:
    """The services while the application runs."""
    database = Database(settings.resolved_database_url)
    await asyncio.to_thread(database.migrate)
    services, elsewhere = _connected(settings, database)
    housekeeping = [
        asyncio.create_task(_now_and_then(TIDY_INTERVAL, _collect_garbage, database, services.artifacts)),
        asyncio.create_task(_now_and_then(CHECKPOINT_INTERVAL, Database.checkpoint, database)),
    ]
    try:
        yield services
    finally:
        for task in housekeeping:
            task.cancel()
        await _close(services, elsewhere)


def _connected(settings: Settings, database: Database) -> tuple[Services, Elsewhere]:
    """The services, each knowing whom to tell, and what listens to other servers for them."""
    loop = asyncio.get_running_loop()

    def observe(state: RecordingState, message: Recorded) -> None:
        hub.accepted(state, message)
        previewer.forget(state.session.id)

    def tell(reconstruction: Reconstruction) -> None:
        loop.call_soon_threadsafe(hub.progressed, reconstruction)
        exchange.post(News("progressed", reconstruction.session, reconstruction.id))

    def heard(news: News) -> None:
        if news.kind in ("recorded", "edited"):
            recorder.stored_elsewhere(news.session, news.number)
            previewer.forget(news.session)
        elsewhere.hear(news)

    metrics, owner = Metrics(), new_id()
    recorder = Recorder(database, settings.max_session_bytes, observe, metrics, owner)
    hub = Hub(database, settings.resolved_database_url, recorder.flush)
    metrics.watch("devices", "Devices connected", lambda: recorder.open_count)
    metrics.watch("watchers", "Browsers that watch a session", lambda: hub.watcher_count)
    previewer, comparer = Previewer(database, recorder.flush, settings.preview_memory), Comparer()
    elsewhere = Elsewhere(database, hub)
    later = loop.call_soon_threadsafe
    exchange = Exchange(database, owner, lambda news: later(heard, news), lambda: later(elsewhere.missed))
    runner, store, tokens = JobRunner(settings, database, tell), open_artifacts(settings), Tokens(database)
    services = Services(
        settings, database, store, recorder, hub, previewer, comparer, metrics, runner, exchange, loop, tokens
    )
    return services, elsewhere


async def _close(services: Services, elsewhere: Elsewhere) -> None:
    await asyncio.to_thread(services.runner.close)
    for service in (services.hub, services.previewer, services.comparer, services.recorder):
        await service.close()
    await asyncio.to_thread(services.exchange.close)
    await elsewhere.close()
    services.database.close()


async def _now_and_then(pause: float, work: Callable[..., None], *arguments: object) -> None:
    """On a thread, at once and then every so many seconds; what fails is only done later."""
    while True:
        try:
            await asyncio.to_thread(work, *arguments)
        except Exception as error:
            log.warning("housekeeping is put off: %s", error)
        await asyncio.sleep(pause)


def _collect_garbage(database: Database, store: ArtifactStore) -> None:
    with database.read() as transaction:
        removed = store.remove_unreferenced(transaction)
    if removed:
        log.info("removed %d artifacts that no reconstruction has any more", removed)
