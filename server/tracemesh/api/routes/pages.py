"""What is not the API: health, and the web app as built."""

from pathlib import Path

from fastapi import APIRouter, FastAPI, Request
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST
from sqlalchemy import select
from starlette.staticfiles import StaticFiles

from tracemesh.api.services import Reading, UseServices

WEB = Path(__file__).resolve().parents[2] / "web"
"""Where `make setup` builds the web app."""
NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8"><title>tracemesh</title>
<body style="font: 16px system-ui; max-width: 36em; margin: 4em auto"><h1>tracemesh</h1>
<p>The server runs, but its web app is not built: run <code>make setup</code>, then load this page again.</p>
<p>The API is described at <a href="/docs">/docs</a>.</p></body></html>"""
router = APIRouter(include_in_schema=False)


@router.get("/healthz")
def healthz() -> PlainTextResponse:
    """The process answers."""
    return PlainTextResponse("ok\n")


@router.get("/readyz")
def readyz(transaction: Reading) -> PlainTextResponse:
    """The database answers too."""
    transaction.execute(select(1))
    return PlainTextResponse("ok\n")


@router.get("/metrics")
def metrics(services: UseServices) -> PlainTextResponse:
    """For Prometheus."""
    return PlainTextResponse(services.metrics.text(), media_type=CONTENT_TYPE_LATEST)


@router.get("/docs")
def docs(request: Request) -> HTMLResponse:
    """The API, to read and to try; nothing is loaded from another host."""
    return get_swagger_ui_html(
        openapi_url="/openapi.json",
        title=f"{request.app.title} API",
        swagger_js_url="/swagger/swagger-ui-bundle.js",
        swagger_css_url="/swagger/swagger-ui.css",
        swagger_favicon_url="/swagger/favicon-32x32.png",
    )


def mount_web(app: FastAPI, folder: Path = WEB) -> None:
    """Serve the web app, or say how it is built; and what the page of the API needs."""
    app.mount("/swagger", StaticFiles(packages=[("fastapi_swagger", "resources")]))
    if (folder / "index.html").is_file():
        app.mount("/", StaticFiles(directory=folder, html=True))
    else:
        app.add_api_route("/", lambda: HTMLResponse(NOT_BUILT), include_in_schema=False)
