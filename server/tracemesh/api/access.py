"""Who may enter: everybody on loopback, the bearer of the token elsewhere; no page of another site anywhere."""

import hmac
from hashlib import sha256
from http.cookies import SimpleCookie
from urllib.parse import parse_qsl, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from tracemesh.api.errors import problem
from tracemesh.settings import LOOPBACK, Settings

COOKIE = "tracemesh"
OPEN_PATHS = frozenset({"/healthz", "/readyz"})
"""What answers without a token; they tell nothing."""
SIGN_IN = """<!doctype html><html lang="en"><meta charset="utf-8"><title>tracemesh</title>
<body style="font: 16px system-ui; max-width: 30em; margin: 4em auto"><h1>tracemesh</h1>
<form action="/"><label>Token <input name="token" type="password" autofocus required></label> <button>Enter</button>
</form></body></html>"""


class Access:
    """ASGI middleware in front of every route and socket."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        """Without a token only loopback names are answered, so that no other site can give us a name of its own."""
        self._app = app
        self._token = settings.token.get_secret_value() if settings.token else None
        self._cookie = "" if self._token is None else sha256(b"tracemesh cookie " + self._token.encode()).hexdigest()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the request through or answer it."""
        refusal = self._refusal(scope) if scope["type"] in ("http", "websocket") else None
        if refusal is None:
            await self._app(scope, receive, send)
        elif scope["type"] == "http":
            await refusal(scope, receive, send)
        else:
            await WebSocketClose(1008, "not allowed")(scope, receive, send)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        path = scope["path"]
        if path in OPEN_PATHS:
            return None
        if not _same_origin(headers):
            return problem(403, f"wanted a request from this server's own pages, got {headers['origin']}", path)
        if self._token is None:
            return None if _host(headers) in LOOPBACK else problem(403, "wanted this machine's own name as host", path)
        return None if self._admitted(headers) else self._ask(scope, headers)

    def _admitted(self, headers: Headers) -> bool:
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and self._matches(given.strip()):
            return True
        cookies: SimpleCookie = SimpleCookie(headers.get("cookie", ""))
        return COOKIE in cookies and hmac.compare_digest(cookies[COOKIE].value.encode(), self._cookie.encode())

    def _matches(self, given: str) -> bool:
        return self._token is not None and hmac.compare_digest(given.encode(), self._token.encode())

    def _ask(self, scope: Scope, headers: Headers) -> Response:
        """A browser may bring the token once in the address; it gets a cookie and an address without it."""
        query = dict(parse_qsl(scope["query_string"].decode("latin-1")))
        given = query.pop("token", None)
        if given is not None and scope["type"] == "http" and scope["method"] == "GET" and self._matches(given):
            target = scope["path"] + (f"?{urlencode(query)}" if query else "")
            answer = RedirectResponse(target, 303)
            secure = scope["scheme"] == "https"
            answer.set_cookie(COOKIE, self._cookie, httponly=True, samesite="strict", secure=secure, max_age=30 * 86400)
            return answer
        if "text/html" in headers.get("accept", ""):
            return HTMLResponse(SIGN_IN, 401)
        return problem(401, "wanted 'Authorization: Bearer TOKEN' with this server's token", scope["path"])


def _same_origin(headers: Headers) -> bool:
    """Only browsers send Origin; theirs must be a page of the host that they ask."""
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc == headers.get("host")


def _host(headers: Headers) -> str:
    try:
        return urlsplit(f"//{headers.get('host', '')}").hostname or ""
    except ValueError:
        return ""
