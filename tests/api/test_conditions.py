"""Conditional requests on what is no file."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest


@pytest.fixture
def paths(server: Any, ride: Any, line: Any) -> list[str]:
    """A session and its curve."""
    session = server.new_session(name="before")
    rider = ride("conditions", session)
    messages = line(30)
    for message in messages:
        rider.send(message)
    rider.wait_for_ack(len(messages) - 1)
    return [f"/sessions/{session}", f"/sessions/{session}/curves/0"]


def test_what_is_known_is_not_sent_again_until_it_changes(server: Any, paths: list[str]) -> None:
    for path, change in zip(paths, ({"name": "after"}, {"boundary": True}), strict=True):
        tag = server.http.get(path).headers["etag"]
        for known in (tag, f"W/{tag}", f'"other", {tag}', "*"):
            again = server.http.get(path, headers={"If-None-Match": known})
            assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
        changed = server.http.patch(path, json=change)
        fresh = server.http.get(path, headers={"If-None-Match": tag})
        assert (fresh.status_code, fresh.json()) == (200, changed.json())
        assert fresh.headers["etag"] == changed.headers["etag"] != tag


def test_nobody_overwrites_what_he_has_not_seen(server: Any, paths: list[str]) -> None:
    for path, change in zip(paths, ({"name": "mine"}, {"marks": []}), strict=True):
        tag = server.http.get(path).headers["etag"]
        assert server.http.patch(path, json=change, headers={"If-Match": tag}).status_code == 200
        late = server.http.patch(path, json=change, headers={"If-Match": tag})
        assert (late.status_code, late.json()["status"]) == (412, 412)
        assert server.http.patch(path, json=change, headers={"If-Match": "*"}).status_code == 200


def test_of_two_at_once_one_wins(server: Any, paths: list[str]) -> None:
    headers = {"If-Match": server.http.get(paths[0]).headers["etag"]}
    with ThreadPoolExecutor(8) as pool:
        asked = [pool.submit(server.http.patch, paths[0], json={"name": f"of {n}"}, headers=headers) for n in range(8)]
    assert sorted(answer.result().status_code for answer in asked) == [200] + 7 * [412]
