"""Runs the service in one process."""

import logging

import uvicorn

from tracemesh.api.app import create_app
from tracemesh.settings import Settings

MAX_MESSAGE = 4 * 2**20
"""Most bytes of one message on a socket."""
DRAIN = 5
"""s that open requests have to end when the server stops."""


def serve(settings: Settings) -> None:
    """Serve until a signal ends it; what was accepted is committed before it returns."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger("alembic").setLevel(logging.WARNING)
    configuration = uvicorn.Config(
        create_app(settings),
        host=settings.host,
        port=settings.port,
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=DRAIN,
        access_log=False,
        log_config=None,
        server_header=False,
    )
    uvicorn.Server(configuration).run()
