"""Letting others in, and out again: tokens over REST and on open sockets."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from tests.api.conftest import Rider
from tracemesh.storage.database import Database
from tracemesh.storage.models import TokenRow

TOKEN = "correct horse battery staple"


@pytest.fixture(scope="module")
def database(database_kind: str, new_database: Callable[[str], str]) -> Any:
    database = Database(new_database(database_kind))
    yield database
    database.close()


@pytest.fixture(scope="module")
def closed(start_server: Callable[..., Any], database: Database) -> Any:
    """A server that others can reach."""
    url = database.engine.url.render_as_string(hide_password=False)
    return start_server(host="0.0.0.0", token=TOKEN, database_url=url)


def made(server: Any, **body: object) -> dict[str, Any]:
    answer = server.http.post("/tokens", json=body)
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


def bearer(token: dict[str, Any]) -> dict[str, str]:
    return {"Authorization": f"Bearer {token['token']}"}


def test_the_secret_is_told_once_and_kept_nowhere(closed: Any, database: Database) -> None:
    session = closed.new_session()
    token = made(closed, role="viewer", session=session, name="Reviewer 2", expires_in=3600)
    left = datetime.fromisoformat(token["expires"]) - datetime.now(UTC)
    assert timedelta(minutes=59) < left <= timedelta(hours=1)
    (listed,) = closed.http.get("/tokens", params={"session": session}).json()
    assert listed == {key: value for key, value in token.items() if key != "token"}
    with database.read() as transaction:
        row = transaction.get(TokenRow, token["id"])
        assert row is not None
        assert token["token"] not in str(vars(row))


def test_the_last_use_is_shown(closed: Any) -> None:
    token = made(closed, role="viewer")
    assert token["last_used"] is None
    before = datetime.now(UTC)
    closed.http.get("/rights", headers=bearer(token)).raise_for_status()
    (listed,) = (t for t in closed.http.get("/tokens").json() if t["id"] == token["id"])
    assert before <= datetime.fromisoformat(listed["last_used"]) <= datetime.now(UTC)


def test_rights_say_what_the_bearer_may_do(closed: Any, server: Any) -> None:
    session = closed.new_session()
    token = made(closed, role="device", session=session)
    rights = closed.http.get("/rights", headers=bearer(token)).json()
    assert rights == {"role": "device", "session": session, "expires": None, "closed": True}
    assert server.http.get("/rights").json() == {"role": "owner", "session": None, "expires": None, "closed": False}


def test_the_owner_of_one_session_shares_that_one_alone(closed: Any) -> None:
    mine, other = closed.new_session(), closed.new_session()
    owner = bearer(made(closed, role="owner", session=mine))
    foreign = made(closed, role="viewer", session=other)
    for wanted in ({"role": "viewer", "session": other}, {"role": "viewer"}):
        assert closed.http.post("/tokens", json=wanted, headers=owner).status_code == 404
    shared = closed.http.post("/tokens", json={"role": "viewer", "session": mine}, headers=owner).json()
    for query in ({}, {"session": other}):
        listed = closed.http.get("/tokens", params=query, headers=owner).json()
        assert {t["session"] for t in listed} == {mine}
    assert closed.http.delete(f"/tokens/{foreign['id']}", headers=owner).status_code == 404
    assert closed.http.delete(f"/tokens/{shared['id']}", headers=owner).status_code == 204


@pytest.mark.parametrize(
    "body",
    [{}, {"role": "king"}, {"role": "viewer", "expires_in": 0}, {"role": "viewer", "expires_in": 10**300}],
)
def test_what_is_no_token_is_refused(closed: Any, body: dict[str, Any]) -> None:
    assert closed.http.post("/tokens", json=body).status_code == 422


def test_a_session_must_exist_to_be_shared(closed: Any) -> None:
    assert closed.http.post("/tokens", json={"role": "viewer", "session": "none"}).status_code == 404
    assert closed.http.delete("/tokens/none").status_code == 404


def test_a_revoked_viewer_sees_no_more(closed: Any) -> None:
    session = closed.new_session()
    token = made(closed, role="viewer", session=session)
    with closed.connect(f"/sessions/{session}/live", additional_headers=bearer(token)) as socket:
        socket.recv(timeout=60)
        assert closed.http.delete(f"/tokens/{token['id']}").status_code == 204
        with pytest.raises(ConnectionClosed) as closing:
            while True:
                socket.recv(timeout=60)
    assert closing.value.rcvd is not None
    assert closing.value.rcvd.code == 4401
    assert closed.http.get("/rights", headers=bearer(token)).status_code == 401


def test_a_viewer_is_sent_away_when_the_token_expires(closed: Any) -> None:
    session = closed.new_session()
    headers = bearer(made(closed, role="viewer", session=session, expires_in=2))
    live = closed.connect(f"/sessions/{session}/live", additional_headers=headers)
    with live as socket, pytest.raises(ConnectionClosed) as closing:
        while True:
            socket.recv(timeout=60)
    assert closing.value.rcvd is not None
    assert closing.value.rcvd.code == 4401


def test_a_revoked_device_is_cut_off_and_what_it_sent_is_kept(closed: Any, line: Any) -> None:
    session = closed.new_session()
    token = made(closed, role="device", session=session)
    with closed.connect("/ingest", additional_headers=bearer(token)) as socket:
        rider = Rider(socket, "cut", session)
        messages = line(50)
        for message in messages:
            rider.send(message)
        rider.wait_for_ack(len(messages) - 1)
        closed.http.delete(f"/tokens/{token['id']}").raise_for_status()
        with pytest.raises(ConnectionClosed):
            while True:
                socket.recv(timeout=60)
    assert closed.http.get(f"/sessions/{session}").json()["samples"] == 50
    with closed.connect("/ingest", additional_headers={"Authorization": f"Bearer {TOKEN}"}) as socket:
        assert Rider(socket, "cut", session).welcome["next_seq"] == len(messages)


def test_what_another_process_revokes_ends_too(closed: Any, database: Database) -> None:
    session = closed.new_session()
    token = made(closed, role="viewer", session=session)
    with closed.connect(f"/sessions/{session}/live", additional_headers=bearer(token)) as socket:
        socket.recv(timeout=60)
        with database.write() as transaction:
            transaction.delete(transaction.get(TokenRow, token["id"]))
        with pytest.raises(ConnectionClosed):
            while True:
                socket.recv(timeout=60)


def test_a_device_records_where_its_token_says(closed: Any) -> None:
    mine, other = closed.new_session(), closed.new_session()
    headers = bearer(made(closed, role="device", session=mine))
    with closed.connect("/ingest", additional_headers=headers) as socket:
        assert Rider(socket, "named", mine).welcome["session"] == mine
    with closed.connect("/ingest", additional_headers=headers) as socket:
        assert Rider(socket, "unnamed", None).welcome["session"] == mine
    with closed.connect("/ingest", additional_headers=headers) as socket:
        refusal = Rider(socket, "foreign", other).welcome
    assert (refusal["type"], refusal["code"]) == ("error", "forbidden")
    assert closed.http.get(f"/sessions/{other}/recordings").json() == []
