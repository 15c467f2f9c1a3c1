"""One error envelope for the whole API: RFC 9457 problem details."""

import logging
from http import HTTPStatus

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from pydantic import ValidationError
from sqlalchemy.exc import IntegrityError, OperationalError
from starlette.exceptions import HTTPException

from tracemesh.errors import Changed, Conflict, NotFound, TracemeshError, Unavailable
from tracemesh.wire.resources import Problem

log = logging.getLogger(__name__)
STATUS = {NotFound: 404, Conflict: 409, Changed: 412, Unavailable: 503}
"""Everything else that tracemesh raises on purpose says that the request's content cannot be used: 422."""


def install_handlers(app: FastAPI) -> None:
    """Answer every error with a problem."""
    app.add_exception_handler(TracemeshError, _on_own_error)
    app.add_exception_handler(HTTPException, _on_http_error)
    app.add_exception_handler(RequestValidationError, _on_invalid_request)
    app.add_exception_handler(OperationalError, _on_storage_error)
    app.add_exception_handler(IntegrityError, _on_race)
    app.add_exception_handler(Exception, _on_bug)


def problem(status: int, detail: str, path: str = "", errors: list[dict[str, object]] | None = None) -> Response:
    """A response that carries a problem."""
    title = HTTPStatus(status).phrase
    body = Problem(title=title, status=status, detail=detail, instance=path, errors=errors or [])
    headers = {"WWW-Authenticate": "Bearer"} if status == HTTPStatus.UNAUTHORIZED else None
    return Response(body.model_dump_json(), status, headers, "application/problem+json")


def validation_problems(error: ValidationError | RequestValidationError) -> list[dict[str, object]]:
    """Per field: where, what was wanted, what came (shortened)."""
    return [
        {"where": ".".join(map(str, e["loc"])), "wanted": e["msg"], "got": repr(e.get("input"))[:200]}
        for e in error.errors()[:20]
    ]


async def _on_own_error(request: Request, error: Exception) -> Response:
    status = next((code for kind, code in STATUS.items() if isinstance(error, kind)), 422)
    return problem(status, str(error), request.url.path)


async def _on_http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if error.status_code == HTTPStatus.NOT_MODIFIED:
        return Response(status_code=304, headers=error.headers)
    return problem(error.status_code, str(error.detail), request.url.path)


async def _on_invalid_request(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    return problem(422, "the request does not fit", request.url.path, validation_problems(error))


async def _on_storage_error(request: Request, error: Exception) -> Response:
    log.error("the database failed: %s", error)
    return problem(503, "the database does not answer, or cannot write", request.url.path)


async def _on_race(request: Request, error: Exception) -> Response:
    log.info("two requests made the same at the same time: %s", error)
    return problem(409, "another request made the same at the same time: ask again", request.url.path)


async def _on_bug(request: Request, error: Exception) -> Response:
    return problem(500, "an error inside tracemesh; the server's log has it", request.url.path)
