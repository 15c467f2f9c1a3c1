"""What the server writes down: one line an event, as text or as JSON, with the request or job that it belongs to."""

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Literal

LogFormat = Literal["text", "json"]
_request: ContextVar[str] = ContextVar("request", default="")
_job: ContextVar[str] = ContextVar("job", default="")


@contextmanager
def about(*, request: str = "", job: str = "") -> Iterator[None]:
    """Whatever is written within this block belongs to this request, or to this job."""
    variable, value = (_request, request) if request else (_job, job)
    token = variable.set(value)
    try:
        yield
    finally:
        variable.reset(token)


def set_up(form: LogFormat) -> None:
    """Write everything from INFO on to standard error."""
    handler = logging.StreamHandler()
    handler.setFormatter(JsonLines() if form == "json" else TextLines())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    logging.getLogger("alembic").setLevel(logging.WARNING)


class TextLines(logging.Formatter):
    """For people."""

    def __init__(self) -> None:
        """Time, level, where, what."""
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s")

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """The line, with what it belongs to."""
        return super().formatMessage(record) + "".join(f" [{kind} {name}]" for kind, name in _belonging())


class JsonLines(logging.Formatter):
    """For programs: one object a line."""

    def format(self, record: logging.LogRecord) -> str:
        """Time (UTC), level, logger, message; request, job and exception where there is one."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
            **dict(_belonging()),
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False)


def _belonging() -> list[tuple[str, str]]:
    return [(kind, name) for kind, name in (("request", _request.get()), ("job", _job.get())) if name]
