"""Who may do what: the one table of every route and socket, with the role and the reach of token that it needs."""

from dataclasses import dataclass
from datetime import UTC, datetime
from re import Pattern
from typing import Literal, get_args

from starlette.routing import compile_path

from tracemesh.wire.access import Role

ROLES: tuple[Role, ...] = get_args(Role)
Reach = Literal["any", "session", "server"]
"""any: the route looks itself; session: a token of the session in the path does; server: one of the whole server."""


@dataclass(frozen=True)
class Need:
    """What a route needs: at least this role, for this reach."""

    role: Role
    reach: Reach


OPEN = None
"""Answers everybody, and tells nothing."""
PAGES = Need("viewer", "any")
LOOK = Need("viewer", "session")
RECORD = Need("device", "session")
EDIT = Need("owner", "session")
SHARE = Need("owner", "any")
SURVEY = Need("viewer", "server")
RULE = Need("owner", "server")
"""Also what is needed for anything that is not in the table."""

SESSION = "/api/v1/sessions/{session}"
CALIBRATIONS = "/api/v1/devices/{device}/calibrations"
BATCH = "/api/v1/batches/{batch}"
RECONSTRUCTION = "/api/v1/reconstructions/{reconstruction}"
TABLE: dict[tuple[str, str], Need | None] = {
    ("GET", "/healthz"): OPEN,
    ("GET", "/readyz"): OPEN,
    ("GET", "/metrics"): RULE,
    ("GET", "/docs"): PAGES,
    ("GET", "/openapi.json"): PAGES,
    ("GET", "/api/v1/rights"): PAGES,
    ("POST", "/api/v1/tokens"): SHARE,
    ("GET", "/api/v1/tokens"): SHARE,
    ("DELETE", "/api/v1/tokens/{token}"): SHARE,
    ("POST", "/api/v1/sessions"): RULE,
    ("GET", "/api/v1/sessions"): SURVEY,
    ("POST", "/api/v1/sessions/archive"): RULE,
    ("GET", SESSION): LOOK,
    ("PATCH", SESSION): EDIT,
    ("DELETE", SESSION): EDIT,
    ("GET", SESSION + "/archive"): LOOK,
    ("GET", SESSION + "/scan.rawnet"): LOOK,
    ("GET", SESSION + "/outline"): LOOK,
    ("POST", SESSION + "/networks"): EDIT,
    ("GET", SESSION + "/nodes"): LOOK,
    ("GET", SESSION + "/segments"): LOOK,
    ("GET", SESSION + "/curves"): LOOK,
    ("GET", SESSION + "/curves/{index}"): LOOK,
    ("PATCH", SESSION + "/curves/{index}"): EDIT,
    ("GET", SESSION + "/recordings"): LOOK,
    ("POST", SESSION + "/recordings"): RECORD,
    ("GET", SESSION + "/recordings/{recording}"): LOOK,
    ("PATCH", SESSION + "/recordings/{recording}"): EDIT,
    ("GET", SESSION + "/readings"): LOOK,
    ("GET", SESSION + "/readings/{number}"): LOOK,
    ("GET", SESSION + "/node-proposals"): EDIT,
    ("GET", SESSION + "/problems"): LOOK,
    ("POST", SESSION + "/preview"): EDIT,
    ("GET", SESSION + "/reconstructions"): LOOK,
    ("POST", SESSION + "/reconstructions"): EDIT,
    ("GET", RECONSTRUCTION): LOOK,
    ("POST", RECONSTRUCTION + "/cancel"): EDIT,
    ("GET", RECONSTRUCTION + "/{name}"): LOOK,
    ("POST", RECONSTRUCTION + "/comparison"): EDIT,
    ("POST", "/api/v1/batches"): RULE,
    ("GET", "/api/v1/batches"): SURVEY,
    ("GET", BATCH): SURVEY,
    ("GET", BATCH + "/reconstructions"): SURVEY,
    ("GET", BATCH + "/results"): SURVEY,
    ("POST", BATCH + "/cancel"): RULE,
    ("GET", "/api/v1/devices"): SURVEY,
    ("GET", "/api/v1/devices/{device}"): SURVEY,
    ("GET", CALIBRATIONS): SURVEY,
    ("GET", CALIBRATIONS + "/{version}"): SURVEY,
    ("POST", CALIBRATIONS): Need("device", "server"),
    ("DELETE", CALIBRATIONS + "/{version}"): RULE,
    ("SOCKET", SESSION + "/live"): LOOK,
    ("SOCKET", "/api/v1/ingest"): Need("device", "any"),
}


@dataclass(frozen=True)
class Principal:
    """Who asks. Without `token` (its identifier): this machine itself, or the owner that the environment names."""

    role: Role
    session: str | None = None
    expires: datetime | None = None
    token: str | None = None
    digest: str | None = None

    @property
    def ended(self) -> bool:
        """Whether the token was revoked or has expired."""
        return self.expires is not None and self.expires <= datetime.now(UTC)

    def refusal(self, need: Need, session: str | None) -> str:
        """Why this is not allowed, in words; empty when it is. `session`: the one that is asked about, if any."""
        if ROLES.index(self.role) < ROLES.index(need.role):
            return f"wanted a token of role {need.role}, got one of role {self.role}"
        if self.session is None or need.reach == "any" or (need.reach == "session" and self.session == session):
            return ""
        return f"wanted a token of the whole server or of this session, got one of session {self.session}"

    def covers(self, other: "Principal") -> bool:
        """Whether whatever the other may do is allowed to this one too."""
        return ROLES.index(self.role) >= ROLES.index(other.role) and self.session in (None, other.session)


Entry = tuple[str, Pattern[str], Need | None]
ENTRIES: tuple[Entry, ...] = tuple((method, compile_path(path)[0], need) for (method, path), need in TABLE.items())


def needed(method: str, path: str) -> tuple[Need | None, dict[str, str]]:
    """What a request needs, and what its path names (`session`, `reconstruction`); `method` SOCKET for sockets."""
    method = "GET" if method == "HEAD" else method
    for entry_method, pattern, need in ENTRIES:
        if entry_method == method and (match := pattern.fullmatch(path)) is not None:
            return need, match.groupdict()
    is_page = method == "GET" and not path.startswith("/api/")
    return (PAGES if is_page else RULE), {}
