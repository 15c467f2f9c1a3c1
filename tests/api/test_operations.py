"""What programs and operators rely on: asking again, compression, readiness, metrics."""

import gzip
from pathlib import Path
from typing import Any

import httpx

KEY = {"Idempotency-Key": "the same"}


def test_asking_again_makes_nothing(server: Any, shared_data: Path) -> None:
    made = [server.http.post("/sessions", json={"name": "once"}, headers=KEY).json() for _ in range(2)]
    assert made[0] == made[1]
    session = made[0]["id"]
    scan = (shared_data / "lilium.rawnet").read_bytes()
    uploads = [server.http.post(f"/sessions/{session}/recordings", content=scan, headers=KEY).json() for _ in range(2)]
    assert uploads[0] == uploads[1]
    assert server.http.get(f"/sessions/{session}").json()["curves"] == 3
    path = f"/sessions/{session}/reconstructions"
    jobs = [server.http.post(path, json={"step": "3%"}, headers=KEY).json() for _ in range(2)]
    assert jobs[0]["id"] == jobs[1]["id"]
    assert len(server.http.get(path).json()) == 1
    assert server.http.post(path, json={"step": "4%"}, headers=KEY).status_code == 409
    assert server.http.post(path, json={"step": "3%"}).json()["id"] != jobs[0]["id"]
    archive = server.http.get(f"/sessions/{session}/archive").content
    copies = [server.http.post("/sessions/archive", content=archive, headers=KEY).json() for _ in range(2)]
    assert copies[0] == copies[1]
    assert copies[0]["curves"] == 3
    assert len(server.http.get("/sessions", params={"name": "once"}).json()) == 2


def test_a_network_sent_again_is_the_same_one(server: Any, shared_data: Path) -> None:
    path, network = f"/sessions/{server.new_session()}/networks", next(shared_data.glob("networks/*.json")).read_bytes()
    jobs = [server.http.post(path, content=network, headers=KEY).json()["id"] for _ in range(2)]
    assert jobs[0] == jobs[1]
    assert server.http.post(path, content=network + b" ", headers=KEY).status_code == 409
    assert server.http.post(path, content=network).json()["id"] != jobs[0]
    for job in {*jobs, *(job["id"] for job in server.http.get(path.replace("networks", "reconstructions")).json())}:
        server.http.post(f"/reconstructions/{job}/cancel")


def test_keys_of_different_sessions_do_not_meet(server: Any) -> None:
    paths = [f"/sessions/{server.new_session()}/reconstructions" for _ in range(2)]
    assert len({server.http.post(path, headers=KEY).json()["id"] for path in paths}) == 2


def test_answers_are_compressed_for_those_who_ask(server: Any, shared_data: Path) -> None:
    session = server.new_session()
    scan = (shared_data / "lilium.rawnet").read_bytes()
    recording = server.http.post(f"/sessions/{session}/recordings", content=scan).json()["id"]
    url = f"/sessions/{session}/recordings/{recording}"
    plain = server.http.get(url, headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    with server.http.stream("GET", url, headers={"Accept-Encoding": "gzip"}) as packed:
        content = b"".join(packed.iter_raw())
    assert packed.headers["content-encoding"] == "gzip"
    assert len(content) < len(plain.content) / 2
    assert gzip.decompress(content) == plain.content


def test_ready_as_long_as_the_database_answers(server: Any) -> None:
    assert httpx.get(f"http://127.0.0.1:{server.port}/readyz").text == "ok\n"


def test_metrics_count_what_happened(server: Any, ride: Any, line: Any) -> None:
    before = _metrics(server)
    rider = ride("counted", server.new_session())
    messages = line(50)
    for message in messages:
        rider.send(message)
    rider.wait_for_ack(len(messages) - 1)
    rider.send({"type": "dance"})
    while rider.receive()["type"] == "ack":
        pass
    after = _metrics(server)
    assert after["tracemesh_messages_total"] - before["tracemesh_messages_total"] == len(messages)
    assert after["tracemesh_message_bytes_total"] > before["tracemesh_message_bytes_total"]
    assert after["tracemesh_commit_seconds_count"] > before["tracemesh_commit_seconds_count"]
    assert after['tracemesh_refusals_total{code="malformed"}'] == 1
    assert {"tracemesh_devices", "tracemesh_watchers"} <= after.keys()


def _metrics(server: Any) -> dict[str, float]:
    text = httpx.get(f"http://127.0.0.1:{server.port}/metrics").text
    rows = [line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#")]
    return {name: float(value) for name, value in rows}
