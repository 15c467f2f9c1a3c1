"""The gate in front of every route and socket: who asks, whether they may, and how often.

Everybody may do everything on loopback; elsewhere the bearer of a token what its role allows; a page of another site
may do nothing anywhere.
"""

import hmac
from contextlib import suppress
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from tracemesh.api.access.buckets import Buckets
from tracemesh.api.access.roles import Need, Principal, needed
from tracemesh.api.errors import problem
from tracemesh.api.services import Services, services
from tracemesh.api.sockets import first_to_end
from tracemesh.settings import LOOPBACK, Settings
from tracemesh.storage.models import ReconstructionRow
from tracemesh.storage.tokens import cookie_of, digest_of

COOKIE = "tracemesh"
COOKIE_AGE = 30 * 86400
"""s"""
FAILURES, FAILURE_RATE = 20, 0.5
"""Wrong tokens from one address: so many at once, so many a second after that."""
MAX_WELCOME = 10_000
"""Clients that are remembered to have come with a token that was good once: others' guesses do not lock them out."""
BURST = 10
"""Seconds' worth of requests that may come at once."""
TOKEN_ENDED = 4401
"""Close code of a socket whose token was revoked or has expired."""
SIGN_IN = """<!doctype html><html lang="en"><meta charset="utf-8"><title>tracemesh</title>
<meta name="viewport" content="width=device-width">
<body style="font: 16px system-ui; max-width: 30em; margin: 4em auto; padding: 0 1em"><h1>tracemesh</h1>
<form action="/"><label>Token <input name="token" type="password" autofocus required></label> <button>Enter</button>
</form></body></html>"""
LOCAL = Principal("owner")
"""Whoever asks where no token is demanded."""


class _Refused(Exception):  # noqa: N818 - an answer, not a failure
    def __init__(self, answer: Response) -> None:
        super().__init__()
        self.answer = answer


class Gate:
    """ASGI middleware; the routes find the `Principal` in the scope."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        """Where no token is demanded only loopback names are answered: no other site can give us a name of its own."""
        self._app = app
        self._closed = settings.closed
        self._owner = digest_of(cookie_of(settings.token.get_secret_value())) if settings.token else None
        self._failures = Buckets(FAILURE_RATE, FAILURES)
        self._welcome: set[tuple[str, str]] = set()
        self._requests = Buckets(settings.max_requests, BURST * settings.max_requests)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the request through or answer it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        try:
            scope["principal"] = await self._admit(scope)
        except _Refused as refused:
            await _answer(refused.answer, scope, receive, send)
        except SQLAlchemyError:
            await _answer(problem(503, "the database does not answer", scope["path"]), scope, receive, send)
        else:
            await self._let_in(scope, receive, send)

    async def _let_in(self, scope: Scope, receive: Receive, send: Send) -> None:
        principal: Principal | None = scope["principal"]
        if scope["type"] == "http" or principal is None or principal.digest is None:
            await self._app(scope, receive, send)
            return
        ended = False

        async def serve() -> None:
            await self._app(scope, receive, send)

        async def watch() -> None:
            nonlocal ended
            await _services(scope).tokens.until_ended(principal)
            ended = True

        await first_to_end(serve(), watch())
        if ended:
            await send({"type": "websocket.close", "code": TOKEN_ENDED, "reason": "the token has ended"})

    async def _admit(self, scope: Scope) -> Principal | None:
        """Who asks; None where everybody may. Raises _Refused."""
        headers, path = Headers(scope=scope), scope["path"]
        need, named = needed("SOCKET" if scope["type"] == "websocket" else scope["method"], path)
        if need is None:
            return None
        if not _same_origin(headers):
            raise _Refused(
                problem(403, f"wanted a request from this server's own pages, got {headers['origin']}", path)
            )
        if not self._closed:
            if _host(headers) not in LOOPBACK:
                raise _Refused(problem(403, "wanted this machine's own name as host", path))
            return LOCAL
        principal = await self._principal(scope, headers)
        reason = principal.refusal(need, await _session_of(scope, principal, need, named))
        if reason:
            raise _Refused(problem(403, reason, path))
        return principal

    async def _principal(self, scope: Scope, headers: Headers) -> Principal:
        """The bearer of the token that the request brings; raises _Refused."""
        bearer, query = _bearer(headers), _query(scope)
        in_address = "" if bearer else query.pop("token", "")
        fresh = await self._bearer_of(scope, cookie_of(bearer or in_address)) if bearer or in_address else None
        kept = None if bearer else await self._bearer_of(scope, _cookie(headers))
        principal = fresh or kept
        self._count(scope, principal)
        if principal is None:
            raise _Refused(_ask(scope, headers))
        if in_address:
            new = fresh is not None and not (kept is not None and kept.covers(fresh))
            raise _Refused(_without_token(scope, query, cookie_of(in_address) if new else None))
        return principal

    async def _bearer_of(self, scope: Scope, cookie: str) -> Principal | None:
        """Whose cookie this is; raises _Refused when too many from there were wrong."""
        if not cookie:
            return None
        digest, address = digest_of(cookie), _address(scope)
        if (address, digest) not in self._welcome and (wait := self._failures.wait(address)):
            raise _Refused(_later(wait, "too many wrong tokens came from there", scope["path"]))
        is_owner = self._owner is not None and hmac.compare_digest(digest, self._owner)
        principal = LOCAL if is_owner else await _services(scope).tokens.find(digest)
        if principal is None:
            self._failures.take(address)
            return None
        if len(self._welcome) >= MAX_WELCOME:
            self._welcome.clear()
        self._welcome.add((address, digest))
        return None if principal.ended else principal

    def _count(self, scope: Scope, principal: Principal | None) -> None:
        """Every client has its share; raises _Refused when it is used up."""
        client = (principal and principal.token) or _address(scope)
        if wait := self._requests.wait(client):
            raise _Refused(_later(wait, "too many requests", scope["path"]))
        self._requests.take(client)


async def _answer(answer: Response, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "http":
        await answer(scope, receive, send)
    else:
        await WebSocketClose(1008, "not allowed")(scope, receive, send)


async def _session_of(scope: Scope, principal: Principal, need: Need, named: dict[str, str]) -> str | None:
    """The session that a request is about, as far as that matters."""
    if principal.session is None or need.reach != "session" or "reconstruction" not in named:
        return named.get("session")

    def read() -> str | None:
        with _services(scope).database.read() as transaction:
            wanted = ReconstructionRow.id == named["reconstruction"]
            return transaction.scalar(select(ReconstructionRow.session_id).where(wanted))

    return await run_in_threadpool(read)


def _services(scope: Scope) -> Services:
    return services(HTTPConnection(scope))


def _bearer(headers: Headers) -> str:
    """The token that a program brings."""
    scheme, _, secret = headers.get("authorization", "").partition(" ")
    return secret.strip() if scheme.lower() == "bearer" else ""


def _query(scope: Scope) -> dict[str, str]:
    """What a page's address asks for; a token may be among it once."""
    if scope["type"] != "http" or scope["method"] != "GET":
        return {}
    return dict(parse_qsl(scope["query_string"].decode("latin-1")))


def _cookie(headers: Headers) -> str:
    try:
        cookies: SimpleCookie = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return ""
    return cookies[COOKIE].value if COOKIE in cookies else ""


def _without_token(scope: Scope, query: dict[str, str], cookie: str | None) -> Response:
    """The same page at an address without the token; a browser that may do more already keeps what it has.

    SameSite=Lax: who follows a link from a mail's or chat's page shall arrive with the cookie.
    """
    path = "/" + quote(scope["path"]).lstrip("/")
    answer = RedirectResponse(path + (f"?{urlencode(query)}" if query else ""), 303)
    answer.headers["Cache-Control"] = "no-store"
    answer.headers["Referrer-Policy"] = "no-referrer"
    if cookie is not None:
        secure = scope["scheme"] == "https"
        answer.set_cookie(COOKIE, cookie, httponly=True, samesite="lax", secure=secure, max_age=COOKIE_AGE)
    return answer


def _ask(scope: Scope, headers: Headers) -> Response:
    if "text/html" in headers.get("accept", ""):
        return HTMLResponse(SIGN_IN, 401)
    return problem(401, "wanted 'Authorization: Bearer TOKEN' with a token that is good here", scope["path"])


def _later(wait: float, why: str, path: str) -> Response:
    answer = problem(429, why, path)
    answer.headers["Retry-After"] = str(int(wait) + 1)
    return answer


def _same_origin(headers: Headers) -> bool:
    """Only browsers send Origin; theirs must be a page of the host that they ask."""
    origin = headers.get("origin")
    if origin is None:
        return True
    with suppress(ValueError):
        return urlsplit(origin).netloc == headers.get("host")
    return False


def _host(headers: Headers) -> str:
    try:
        return urlsplit(f"//{headers.get('host', '')}").hostname or ""
    except ValueError:
        return ""


def _address(scope: Scope) -> str:
    return scope["client"][0] if scope.get("client") else ""
