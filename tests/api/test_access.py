"""How people and pages come in: signing in, cookies, foreign pages, names, and how often."""

from collections.abc import Callable
from typing import Any

import httpx
import pytest

from tracemesh.api.access.gate import FAILURES

TOKEN = "correct horse battery staple"


@pytest.fixture(scope="module")
def closed(start_server: Callable[..., Any]) -> Any:
    """A server that others can reach."""
    return start_server(host="0.0.0.0", token=TOKEN)


def test_a_page_trades_the_token_for_a_cookie_and_loses_it_from_its_address(closed: Any) -> None:
    with httpx.Client(base_url=f"http://127.0.0.1:{closed.port}", headers={"Accept": "text/html"}) as browser:
        assert "<form" in browser.get("/").text
        assert browser.get("/?token=wrong").status_code == 401
        answer = browser.get(f"/?token={TOKEN.replace(' ', '+')}&view=1")
        assert (answer.status_code, answer.headers["location"]) == (303, "/?view=1")
        assert "HttpOnly" in answer.headers["set-cookie"]
        assert TOKEN not in answer.headers["set-cookie"]
        assert browser.get("/api/v1/sessions").status_code == 200


def test_a_link_from_elsewhere_arrives_with_its_cookie_and_leads_nowhere_else(closed: Any) -> None:
    with httpx.Client(base_url=f"http://127.0.0.1:{closed.port}") as browser:
        answer = browser.get(f"{browser.base_url}/evil.example/", params={"token": TOKEN})
        assert answer.headers["location"] == "/evil.example/"
        assert "SameSite=lax" in answer.headers["set-cookie"]
        assert answer.headers["cache-control"] == "no-store"


def test_a_link_to_less_does_not_take_away_what_a_browser_may_do(closed: Any) -> None:
    session = closed.new_session()
    viewer = closed.http.post("/tokens", json={"role": "viewer", "session": session}).json()["token"]
    with httpx.Client(base_url=f"http://127.0.0.1:{closed.port}") as browser:
        browser.get("/", params={"token": viewer})
        assert browser.get("/api/v1/rights").json()["role"] == "viewer"
        browser.get("/", params={"token": TOKEN})
        assert browser.get("/api/v1/rights").json()["role"] == "owner"
        answer = browser.get("/", params={"token": viewer})
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        assert browser.get("/api/v1/rights").json() == {
            "role": "owner",
            "session": None,
            "expires": None,
            "closed": True,
        }


def test_a_wrong_header_is_not_made_good_by_a_cookie(closed: Any) -> None:
    with httpx.Client(base_url=f"http://127.0.0.1:{closed.port}") as browser:
        browser.get("/", params={"token": TOKEN})
        assert browser.get("/api/v1/rights").status_code == 200
        assert browser.get("/api/v1/rights", headers={"Authorization": "Bearer wrong"}).status_code == 401


def test_whoever_guesses_is_sent_away_for_a_while(start_server: Callable[..., Any]) -> None:
    server = start_server(host="0.0.0.0", token=TOKEN)
    viewer = server.http.post("/tokens", json={"role": "viewer"}).json()["token"]
    good = {"Authorization": f"Bearer {viewer}"}
    assert server.http.get("/rights", headers=good).status_code == 200
    guesses = [server.http.get("/rights", headers={"Authorization": f"Bearer {n}"}) for n in range(3 * FAILURES)]
    assert guesses[0].status_code == 401
    late = next(answer for answer in guesses if answer.status_code == 429)
    assert int(late.headers["retry-after"]) >= 1
    assert late.headers["content-type"] == "application/problem+json"


def test_a_client_that_asks_too_often_is_told_to_wait(start_server: Callable[..., Any]) -> None:
    server = start_server(host="0.0.0.0", token=TOKEN, max_requests=1)
    answers = [server.http.get("/rights").status_code for _ in range(40)]
    assert answers[0] == 200
    assert 429 in answers


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


def test_an_origin_that_is_no_address_is_foreign(server: Any) -> None:
    for origin in ("http://[", "null", "", "http://"):
        assert server.http.get("/sessions", headers={"Origin": origin}).status_code == 403


def test_a_name_that_somebody_else_gave_to_this_machine_is_not_answered(server: Any) -> None:
    for host in ("evil.example", f"evil.example:{server.port}", "127.0.0.1.evil.example", "[bad"):
        assert server.http.get("/sessions", headers={"Host": host}).status_code == 403
    for host in ("localhost", f"localhost:{server.port}", "[::1]:8000"):
        assert server.http.get("/sessions", headers={"Host": host}).status_code == 200


FORWARDED = {"X-Forwarded-Proto": "https", "X-Forwarded-For": "203.0.113.7"}


@pytest.mark.parametrize(("trusted", "secure"), [("127.0.0.0/8", True), ("203.0.113.9", False), ("", False)])
def test_a_proxys_word_counts_only_when_it_is_trusted(
    start_server: Callable[..., Any], trusted: str, secure: bool
) -> None:
    server = start_server(token=TOKEN, trusted_proxies=trusted)
    with httpx.Client(base_url=f"http://127.0.0.1:{server.port}", headers=FORWARDED) as behind:
        assert ("Secure" in behind.get("/", params={"token": TOKEN}).headers["set-cookie"]) == secure
        wrong = {"Authorization": "Bearer wrong"}
        while behind.get("/api/v1/rights", headers=wrong).status_code != 429:
            pass
    other = httpx.get(f"http://127.0.0.1:{server.port}/api/v1/rights", headers=wrong)
    assert (other.status_code == 401) == secure, "limits count the client, not the proxy"
