"""Closed by default: every route and socket, off loopback, from foreign pages, and by name."""

import re
from collections.abc import Callable
from typing import Any

import httpx
import pytest

from tracemesh.api.app import create_app
from tracemesh.settings import Settings

TOKEN = "correct horse battery staple"


def routes() -> list[tuple[str, str]]:
    """Method and path of everything that the application answers."""
    found: list[tuple[str, str]] = [("GET", "/"), ("GET", "/docs"), ("GET", "/openapi.json"), ("GET", "/nothing")]
    for path, operations in create_app(Settings()).openapi()["paths"].items():
        found += [(method.upper(), re.sub(r"{\w+}", "0", path)) for method in operations]
    return found


@pytest.fixture(scope="module")
def closed(start_server: Callable[..., Any]) -> Any:
    """A server that others can reach."""
    return start_server(host="0.0.0.0", token=TOKEN)


def test_the_list_of_routes_is_worth_something() -> None:
    assert len(routes()) > 15
    assert ("DELETE", "/api/v1/sessions/0") in routes()


@pytest.mark.parametrize(("method", "path"), routes())
def test_every_route_demands_the_token(closed: Any, method: str, path: str) -> None:
    url = f"http://127.0.0.1:{closed.port}{path}"
    for headers in (
        {},
        {"Authorization": "Bearer wrong"},
        {"Authorization": f"Basic {TOKEN}"},
        {"Cookie": "tracemesh=x"},
    ):
        answer = httpx.request(method, url, headers=headers)
        assert answer.status_code == 401
        assert answer.headers["content-type"] == "application/problem+json"
    assert httpx.request(method, url, headers={"Authorization": f"Bearer {TOKEN}"}).status_code != 401


@pytest.mark.parametrize("path", ["/ingest", "/sessions/0/live"])
def test_every_socket_demands_the_token(closed: Any, path: str) -> None:
    with pytest.raises(Exception, match="403"), closed.connect(path):
        pass
    with closed.connect(path, additional_headers={"Authorization": f"Bearer {TOKEN}"}):
        pass


def test_a_page_trades_the_token_for_a_cookie_and_loses_it_from_its_address(closed: Any) -> None:
    with httpx.Client(base_url=f"http://127.0.0.1:{closed.port}", headers={"Accept": "text/html"}) as browser:
        assert "<form" in browser.get("/").text
        assert browser.get("/?token=wrong").status_code == 401
        answer = browser.get(f"/?token={TOKEN.replace(' ', '+')}&view=1")
        assert (answer.status_code, answer.headers["location"]) == (303, "/?view=1")
        assert "HttpOnly" in answer.headers["set-cookie"]
        assert TOKEN not in answer.headers["set-cookie"]
        assert browser.get("/api/v1/sessions").status_code == 200


def test_health_needs_no_token(closed: Any) -> None:
    assert httpx.get(f"http://127.0.0.1:{closed.port}/healthz").text == "ok\n"


def test_pages_of_other_sites_are_kept_out(server: Any) -> None:
    own, foreign = f"http://127.0.0.1:{server.port}", "http://evil.example"
    assert server.http.post("/sessions", json={}, headers={"Origin": own}).status_code == 201
    assert server.http.post("/sessions", json={}, headers={"Origin": foreign}).status_code == 403
    assert server.http.get("/sessions", headers={"Origin": "null"}).status_code == 403
    for path in ("/ingest", "/sessions/0/live"):
        with pytest.raises(Exception, match="403"), server.connect(path, origin=foreign):
            pass
        with server.connect(path, origin=own):
            pass


def test_a_name_that_somebody_else_gave_to_this_machine_is_not_answered(server: Any) -> None:
    for host in ("evil.example", f"evil.example:{server.port}", "127.0.0.1.evil.example", "[bad"):
        assert server.http.get("/sessions", headers={"Host": host}).status_code == 403
    for host in ("localhost", f"localhost:{server.port}", "[::1]:8000"):
        assert server.http.get("/sessions", headers={"Host": host}).status_code == 200
