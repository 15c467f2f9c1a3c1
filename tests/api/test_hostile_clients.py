"""Clients that mean harm: slow, greedy, deep, huge, and those who want out of the folder."""

import http.client
import io
import json
import socket
import struct
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.api import limits
from tracemesh.errors import InputError
from tracemesh.storage.archive import read_archive

HELLO = b"POST /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"


@pytest.fixture(scope="module")
def plain(start_server: Callable[..., Any]) -> Any:
    """A server for few devices and small sessions."""
    return start_server(max_session_bytes=2**20, max_upload_bytes=2**21)


def drip(server: Any, begin: bytes, drops: bytes = b"x") -> bytes:
    """Send a beginning, then a byte now and then until the server has had enough; what it said."""
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        connection.sendall(begin)
        connection.settimeout(0.05)
        said = b""
        while True:
            try:
                connection.sendall(drops)
                received = connection.recv(4096)
            except TimeoutError:
                assert server.http.get("/sessions").status_code == 200, "others are served meanwhile"
                continue
            except OSError:
                return said
            said += received
            if not received:
                return said


@pytest.mark.parametrize("begin", [b"", b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: "])
def test_a_head_that_drips_in_is_given_up(plain: Any, begin: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "HEAD_TIMEOUT", 1.0)
    assert drip(plain, begin, b"x" if begin else b"G") == b""


def test_a_second_head_on_a_connection_has_no_more_time(plain: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "HEAD_TIMEOUT", 1.0)
    said = drip(plain, b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\nGET / HTTP/1.1\r\nX-Slow: ")
    assert said.startswith(b"HTTP/1.1 200")


def test_a_body_that_drips_in_is_given_up(plain: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "GRACE", 1.0)
    said = drip(plain, HELLO + b"Content-Length: 100000\r\nConnection: close\r\n\r\n")
    assert said.startswith(b"HTTP/1.1 408")


def test_an_answer_that_nobody_reads_is_given_up(plain: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "STUCK_TIMEOUT", 0.5)
    request = b"GET /swagger/swagger-ui-bundle.js HTTP/1.1\r\nHost: localhost\r\nAccept-Encoding: identity\r\n\r\n"
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect(("127.0.0.1", plain.port))
        connection.sendall(request * 20)
        received = 0
        time.sleep(2)
        connection.settimeout(20)
        try:
            while chunk := connection.recv(2**16):
                received += len(chunk)
        except ConnectionResetError:
            pass
    whole = len(httpx.get(f"http://127.0.0.1:{plain.port}/swagger/swagger-ui-bundle.js").content)
    assert received < 20 * whole


def test_a_head_without_end_is_refused(plain: Any) -> None:
    with socket.create_connection(("127.0.0.1", plain.port)) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n")
        said = b""
        try:
            for _ in range(100):
                connection.sendall(b"X-Huge: " + b"x" * 10_000 + b"\r\n")
            said = connection.recv(4096)
        except OSError:
            pass
    assert said == b"" or said.startswith(b"HTTP/1.1 4")
    assert plain.http.get("/sessions").status_code == 200


DEEP = "[" * 100_000 + "]" * 100_000
BODIES = [
    DEEP,
    '{"name": ' + DEEP + "}",
    '{"a":' * 50_000 + "1" + "}" * 50_000,
    '{"name": ' + "9" * 100_000 + "}",
    '{"name": 1e999999}',
    '{"name": NaN}',
    '{"name": "' + "x" * 100_000 + '"}',
    '{"name": "\\ud800"}',
    "\x00",
]


@pytest.mark.parametrize("body", BODIES, ids=range(len(BODIES)))
def test_deep_and_giant_json_is_refused(plain: Any, body: str) -> None:
    for method, path in (("POST", "/sessions"), ("PATCH", "/sessions/x"), ("POST", "/tokens")):
        answer = plain.http.request(method, path, content=body, headers={"Content-Type": "application/json"})
        assert 400 <= answer.status_code < 500
        assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("body", BODIES, ids=range(len(BODIES)))
def test_deep_and_giant_messages_are_refused(plain: Any, body: str) -> None:
    with plain.connect("/ingest") as device:
        device.send(body)
        assert json.loads(device.recv(timeout=60))["code"] == "malformed"


@pytest.mark.parametrize("value", ["-1", "99999999999999999999", "1e9", "0x10", "²", "NaN", "9" * 5000])
def test_giant_numbers_in_an_address_are_refused(plain: Any, value: str) -> None:
    session = plain.new_session()
    assert plain.http.get("/sessions", params={"limit": value}).status_code == 422
    assert plain.http.get(f"/sessions/{session}/curves/{value}").status_code in (404, 422)


def test_a_body_that_is_too_large_is_refused(plain: Any) -> None:
    json_type = {"Content-Type": "application/json"}
    whole = b" " * (limits.MAX_JSON + 1)
    assert plain.http.post("/sessions", content=whole, headers=json_type).status_code == 413

    def chunks() -> Any:
        yield from (whole[i : i + 2**20] for i in range(0, len(whole), 2**20))

    assert plain.http.post("/sessions", content=chunks(), headers=json_type).status_code == 413
    session = plain.new_session()
    assert plain.http.post(f"/sessions/{session}/recordings", content=b" " * (2**21 + 1)).status_code == 422
    assert plain.http.post("/sessions/archive", content=b" " * (2**21 + 1)).status_code == 422


@pytest.mark.parametrize(
    "path",
    [
        "/../../../../etc/passwd",
        "/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
        "/..%2f..%2f..%2f..%2fetc/passwd",
        "/swagger/../../../../../etc/passwd",
        "/swagger/..%5c..%5cetc%5cpasswd",
        "/swagger/%2fetc%2fpasswd",
        "//etc/passwd",
        "/..%00/etc/passwd",
        "/api/v1/sessions/..%2f..%2ftracemesh.db/archive",
        "/api/v1/reconstructions/..%2f..%2fx/..%2f..%2fmesh.glb",
    ],
)
def test_no_path_leads_out(plain: Any, path: str) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", plain.port)
    connection.request("GET", path)
    answer = connection.getresponse()
    assert answer.status in (404, 422)
    assert b"root:" not in answer.read()
    connection.close()


def archive(**entries: bytes) -> bytes:
    """A zip of these files."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in entries.items():
            made.writestr(name, content)
    return file.getvalue()


def manifest(**files: str) -> bytes:
    return json.dumps({"name": "", "curves": [], "reconstructions": [], "files": files}).encode()


def test_a_bomb_is_not_unpacked(plain: Any) -> None:
    bomb = archive(**{"session.json": manifest(zeros="0" * 64), "zeros": bytes(2**26)})
    assert len(bomb) < 2**17
    answer = plain.http.post("/sessions/archive", content=bomb)
    assert answer.status_code == 422
    assert "at most" in answer.json()["detail"]


def test_an_archive_that_lies_about_a_size_is_refused(plain: Any) -> None:
    bomb = bytearray(archive(**{"session.json": manifest(zeros="0" * 64), "zeros": bytes(2**26)}))
    true = struct.pack("<I", 2**26)
    while (place := bomb.find(true)) >= 0:
        bomb[place : place + 4] = struct.pack("<I", 1000)
    answer = plain.http.post("/sessions/archive", content=bytes(bomb))
    assert answer.status_code == 422


def test_names_in_an_archive_write_nowhere(plain: Any, tmp_path: Path) -> None:
    name = f"recordings/../../../../../../..{tmp_path}/evil"
    answer = plain.http.post(
        "/sessions/archive", content=archive(**{"session.json": manifest(**{name: "0"}), name: b""})
    )
    assert answer.status_code == 422
    assert list(tmp_path.iterdir()) == []


SOUND = archive(**{"session.json": manifest(), "artifacts/x": b"content " * 50})


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.integers(0, len(SOUND) - 1), st.integers(0, 255)), min_size=1, max_size=8))
def test_a_damaged_archive_is_an_input_error_or_whole(damage: list[tuple[int, int]]) -> None:
    damaged = bytearray(SOUND)
    for place, value in damage:
        damaged[place] = value
    with suppress(InputError):
        read_archive(io.BytesIO(bytes(damaged)), 2**20)
