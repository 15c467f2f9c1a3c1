"""Every route and socket, asked by everybody: what a role may do, where, and for how long."""

import re
from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import Any

import httpx
import pytest
from starlette.routing import Mount

from tracemesh.api.access.roles import TABLE, needed
from tracemesh.api.app import create_app
from tracemesh.settings import Settings
from tracemesh.storage.database import Database
from tracemesh.storage.models import ReconstructionRow, TokenRow, now

TOKEN = "correct horse battery staple"
VIEWER = {
    ("GET", "/docs"),
    ("GET", "/openapi.json"),
    ("GET", "/api/v1/rights"),
    ("GET", "/api/v1/sessions/{session}"),
    ("GET", "/api/v1/sessions/{session}/archive"),
    ("GET", "/api/v1/sessions/{session}/outline"),
    ("GET", "/api/v1/sessions/{session}/problems"),
    ("GET", "/api/v1/sessions/{session}/scan.rawnet"),
    ("GET", "/api/v1/sessions/{session}/nodes"),
    ("GET", "/api/v1/sessions/{session}/segments"),
    ("GET", "/api/v1/sessions/{session}/curves"),
    ("GET", "/api/v1/sessions/{session}/curves/{index}"),
    ("GET", "/api/v1/sessions/{session}/recordings"),
    ("GET", "/api/v1/sessions/{session}/recordings/{recording}"),
    ("GET", "/api/v1/sessions/{session}/readings"),
    ("GET", "/api/v1/sessions/{session}/readings/{number}"),
    ("GET", "/api/v1/sessions/{session}/reconstructions"),
    ("GET", "/api/v1/reconstructions/{reconstruction}"),
    ("GET", "/api/v1/reconstructions/{reconstruction}/{name}"),
    ("SOCKET", "/api/v1/sessions/{session}/live"),
}
"""What the viewer of a session may do, written down once more: looking, and nothing that costs or changes anything."""
SURVEY = {
    ("GET", "/api/v1/sessions"),
    ("GET", "/api/v1/devices"),
    ("GET", "/api/v1/devices/{device}"),
    ("GET", "/api/v1/devices/{device}/calibrations"),
    ("GET", "/api/v1/devices/{device}/calibrations/{version}"),
    ("GET", "/api/v1/batches"),
    ("GET", "/api/v1/batches/{batch}"),
    ("GET", "/api/v1/batches/{batch}/reconstructions"),
    ("GET", "/api/v1/batches/{batch}/results"),
}
"""What a viewer of the whole server may do besides."""
DEVICE = VIEWER | {("POST", "/api/v1/sessions/{session}/recordings"), ("SOCKET", "/api/v1/ingest")}


def routes(of: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Method and path of everything that the application answers, folders of files apart."""
    for route in of:
        if hasattr(route, "original_router"):
            yield from routes(route.original_router.routes, prefix + route.include_context.prefix)
        elif not isinstance(route, Mount):
            methods = getattr(route, "methods", None) or {"SOCKET"}
            yield from ((method, prefix + route.path) for method in methods - {"HEAD"})


ALL = sorted(set(routes(create_app(Settings()).routes)) - {("GET", "/")})
CLOSED = [route for route in ALL if TABLE.get(route)]


def test_the_table_is_complete_and_has_nothing_else() -> None:
    assert len(ALL) > 25
    assert set(ALL) == TABLE.keys()


def test_only_health_is_open() -> None:
    assert {path for (_, path), need in TABLE.items() if need is None} == {"/healthz", "/readyz"}


@pytest.mark.parametrize("path", ["/api/v1/nothing", "/api", "/api/v2/sessions", "/api/v1/sessions/x/nothing"])
def test_what_is_not_in_the_table_is_the_owners(path: str) -> None:
    for method in ("GET", "POST", "OPTIONS", "SOCKET"):
        need, _ = needed(method, path)
        assert need is not None
        assert path == "/api" or (need.role, need.reach) == ("owner", "server")


class World:
    """A closed server with two sessions and a token of every kind."""

    def __init__(self, server: Any, database: Database) -> None:
        self.server, self.database = server, database
        for session in ("mine", "other"):
            server.new_session(id=session)
            with database.write() as transaction:
                transaction.add(ReconstructionRow(id=f"job-{session}", session_id=session, state="done", parameters={}))
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60)

    def token(self, role: str, session: str | None = None) -> str:
        return str(self.server.http.post("/tokens", json={"role": role, "session": session}).json()["token"])

    def ask(self, route: tuple[str, str], token: str, session: str = "mine", **headers: str) -> int:
        """Status of the answer; a socket that opens has 200. Nothing is changed: the bodies fit no route."""
        method, template = route
        path = re.sub(r"{session}", session, template).replace("{reconstruction}", f"job-{session}")
        path = re.sub(r"{\w+}", "0", path)
        bearer = {"Authorization": f"Bearer {token}"} if token else {}
        if method == "SOCKET":
            return self._open(path, {**bearer, **headers})
        body = {} if method in ("GET", "DELETE") else {"json": {"no such field": 1}}
        return self.client.request(method, path, headers={**bearer, **headers}, **body).status_code

    def _open(self, path: str, headers: dict[str, str]) -> int:
        try:
            with self.server.connect(path.removeprefix("/api/v1"), additional_headers=headers):
                return 200
        except Exception as error:
            return int(re.findall(r"HTTP (\d+)", str(error))[0])


@pytest.fixture(scope="module")
def world(database_kind: str, start_server: Callable[..., Any], new_database: Callable[[str], str]) -> Iterator[World]:
    url = new_database(database_kind)
    server = start_server(host="0.0.0.0", token=TOKEN, database_url=url, max_requests=10_000)
    database = Database(url)
    world = World(server, database)
    yield world
    world.client.close()
    database.close()


def refusals(world: World, token: str, session: str = "mine", **headers: str) -> set[tuple[str, str]]:
    """Routes that refuse, after asking all; deleting a session is not tried where it would work."""
    return {route for route in CLOSED if world.ask(route, token, session, **headers) in (401, 403)}


def test_every_route_and_socket_demands_a_token_that_is_good(world: World) -> None:
    ended = world.token("owner")
    revoked = world.server.http.post("/tokens", json={"role": "owner"}).json()
    assert world.ask(("GET", "/api/v1/sessions"), revoked["token"]) == 200
    world.server.http.delete(f"/tokens/{revoked['id']}").raise_for_status()
    with world.database.write() as transaction:
        for row in transaction.query(TokenRow).where(TokenRow.role == "owner"):
            row.expires = now() - timedelta(seconds=1)
    for token in ("", ended, revoked["token"]):
        for route in CLOSED:
            assert world.ask(route, token) == (403 if route[0] == "SOCKET" else 401), route


def test_other_ways_to_bring_it_do_not_count(world: World) -> None:
    for headers in ({"Authorization": f"Basic {TOKEN}"}, {"Cookie": "tracemesh=x"}, {"Cookie": f"tracemesh={TOKEN}"}):
        assert world.ask(("GET", "/api/v1/sessions"), "", **headers) == 401


def test_a_viewer_looks_at_its_session_and_does_nothing_else(world: World) -> None:
    assert set(CLOSED) - refusals(world, world.token("viewer", "mine")) == VIEWER


def test_a_device_records_into_its_session_and_does_nothing_else(world: World) -> None:
    assert set(CLOSED) - refusals(world, world.token("device", "mine")) == DEVICE


@pytest.mark.parametrize("role", ["viewer", "device", "owner"])
def test_a_token_of_another_session_opens_nothing_of_this_one(world: World, role: str) -> None:
    token = world.token(role, "other")
    about_it = {route for route in CLOSED if "{session}" in route[1] or "{reconstruction}" in route[1]}
    assert about_it <= refusals(world, token, "mine")


def test_the_owner_of_a_session_does_everything_with_it_but_nothing_with_the_server(world: World) -> None:
    refused = SURVEY | {
        ("GET", "/metrics"),
        ("POST", "/api/v1/sessions"),
        ("POST", "/api/v1/sessions/archive"),
        ("POST", "/api/v1/batches"),
        ("POST", "/api/v1/batches/{batch}/cancel"),
        ("POST", "/api/v1/devices/{device}/calibrations"),
        ("DELETE", "/api/v1/devices/{device}/calibrations/{version}"),
    }
    world.server.new_session(id="spent")
    with world.database.write() as transaction:
        transaction.add(ReconstructionRow(id="job-spent", session_id="spent", state="done", parameters={}))
    token = world.token("owner", "spent")
    last = ("DELETE", "/api/v1/sessions/{session}")
    assert {r for r in CLOSED if r != last and world.ask(r, token, "spent") in (401, 403)} == refused
    assert world.ask(last, token, "spent") == 204
    assert world.ask(("GET", "/api/v1/rights"), token) == 401, "the token went with its session"


def test_roles_of_the_whole_server_reach_every_session(world: World) -> None:
    for session in ("mine", "other"):
        viewer = set(CLOSED) - refusals(world, world.token("viewer"), session)
        assert viewer == VIEWER | SURVEY
        calibrate = ("POST", "/api/v1/devices/{device}/calibrations")
        assert set(CLOSED) - refusals(world, world.token("device"), session) == DEVICE | viewer | {calibrate}


def test_the_owners_own_token_is_no_use_to_a_foreign_page(world: World) -> None:
    assert refusals(world, TOKEN, Origin="http://evil.example") == set(CLOSED)


def test_pages_and_files_need_a_token_of_any_kind(world: World) -> None:
    viewer = {"Authorization": f"Bearer {world.token('viewer', 'mine')}"}
    for path in ("/", "/index.html", "/swagger/swagger-ui.css", "/nothing.js"):
        assert world.client.get(path).status_code == 401
        assert world.client.get(path, headers=viewer).status_code in (200, 404)
