"""Runs the service in one process."""

import asyncio
import errno
import gc
import socket
from contextlib import suppress
from ipaddress import ip_address
from typing import TYPE_CHECKING

import uvicorn

from tracemesh import logs
from tracemesh.api.app import create_app
from tracemesh.api.limits import PatientHttp
from tracemesh.api.websocket import SteadyReading
from tracemesh.api.welcome import greet, greet_phones
from tracemesh.errors import ResourceError
from tracemesh.settings import Settings
from tracemesh.storage.artifacts import open_artifacts
from tracemesh.storage.database import Database, database_faults_in_words

if TYPE_CHECKING:
    from tracemesh.api.lan.serving import Lan

MAX_MESSAGE = 4 * 2**20
"""Most bytes of one message on a socket."""
DRAIN = 5
"""s that open requests have to end when the server stops."""
MAX_CLIENTS = 1000
"""Connections besides those of devices."""
COLLECT_AFTER = (50_000, 20, 100)
"""New objects until the garbage collector looks through the youngest; how often it does before it looks further."""


def serve(settings: Settings) -> None:
    """Serve until a signal ends it; what was accepted is committed before it returns.

    Raises ResourceError when the data folder, the database or the address cannot be used.
    """
    logs.set_up(settings.log_format)
    _check_address(settings.listen_host, settings.port)
    _prepare(settings)
    _collect_garbage_seldom()
    lan = _lan(settings) if settings.lan else None
    try:
        _Server(configure(settings, lan), settings, lan).run()
    except SystemExit:  # uvicorn's word for an address that it could not have; its log says why
        raise ResourceError(f"cannot listen at {settings.listen_host}:{settings.port}") from None
    finally:
        if lan is not None:
            lan.close()


def _lan(settings: Settings) -> "Lan":
    from tracemesh.api.lan.serving import Lan  # what makes certificates takes memory that other servers save

    return Lan(settings)


def configure(settings: Settings, lan: "Lan | None" = None) -> uvicorn.Config:
    """How uvicorn is to serve the application."""
    return uvicorn.Config(
        create_app(settings),
        host=settings.listen_host,
        port=settings.port,
        lifespan="on",
        http=PatientHttp,
        ssl_certfile=None if lan is None else lan.certificate,
        ssl_keyfile=None if lan is None else lan.key,
        ws=SteadyReading,
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
        limit_concurrency=settings.max_devices + MAX_CLIENTS,
        forwarded_allow_ips=settings.trusted_proxies or [],
        timeout_graceful_shutdown=DRAIN,
        access_log=False,
        log_config=None,
        server_header=False,
    )


def _collect_garbage_seldom() -> None:
    """Everybody waits while the collector looks: spare it what lives as long as the process, and messages."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(*COLLECT_AFTER)
    gc.enable()


class _Server(uvicorn.Server):
    """Says how to come in as soon as it listens."""

    def __init__(self, configuration: uvicorn.Config, settings: Settings, lan: "Lan | None") -> None:
        super().__init__(configuration)
        self._settings = settings
        self._lan = lan

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        port, context = self.servers[0].sockets[0].getsockname()[1], self.config.ssl
        if self._settings.closed:
            await asyncio.to_thread(greet, self._settings, port)
        if self._lan is not None and context is not None:
            plain = await asyncio.to_thread(self._lan.open, context, port)
            greet_phones(self._lan.authority, plain)


def _check_address(host: str, port: int) -> None:
    """Say what keeps us from an address before anything starts; what a name means is left to uvicorn."""
    with suppress(ValueError):
        family = socket.AF_INET6 if ip_address(host).version == 6 else socket.AF_INET
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, port))
            except OSError as error:
                advice = "; another --port, or 0 for a free one?" if error.errno == errno.EADDRINUSE else ""
                raise ResourceError(f"cannot listen at {host}:{port}: {error.strerror}{advice}") from None


def _prepare(settings: Settings) -> None:
    """Meet what would keep the service from starting while it can still be said in words."""
    try:
        open_artifacts(settings)
        with database_faults_in_words():
            database = Database(settings.resolved_database_url)
            database.migrate()
            database.close()
    except OSError as error:
        raise ResourceError(f"the data folder {settings.data_dir} cannot be used: {error.strerror}") from None
