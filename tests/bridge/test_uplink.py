"""The uplink against a real WebSocket server that misbehaves."""

import asyncio

import pytest

from tracemesh.wire.device import CurveStart, Device, ErrorMessage, Hello
from tracemesh_bridge import uplink as module
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.source import Link
from tracemesh_bridge.spool import Spool
from tracemesh_bridge.uplink import WINDOW, Uplink, ingest_url

HELLO = Hello(recording="r", session="s", device=Device(id="d", kind="k"))


@pytest.fixture
def spool(tmp_path):
    spool = Spool(tmp_path, HELLO, segment_bytes=2000)
    yield spool
    spool.close()


def fill(spool, count):
    for _ in range(count):
        spool.append(CurveStart(seq=spool.next_seq, curve=spool.next_seq))
    spool.sync()


def run(spool, address, until=None, token=""):
    """Upload until a condition holds, or all is sent; returns what was said."""
    said = []

    async def main():
        uplink = Uplink(address, token, spool, Link("server", said.append))
        task = asyncio.create_task(uplink.run())
        if until is None:
            await asyncio.wait_for(uplink.finished(), 30)
        else:
            async with asyncio.timeout(30):
                while not until("\n".join(said)):
                    await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(main())
    return "\n".join(said)


@pytest.fixture(autouse=True)
def in_a_hurry(monkeypatch):
    monkeypatch.setattr(module, "FIRST_DELAY", 0.01)
    monkeypatch.setattr(module, "LONGEST_DELAY", 0.1)


def test_all_is_sent_in_order_and_deleted_once_acknowledged(spool, server, tmp_path):
    fill(spool, 1000)
    assert (
        run(spool, server.address) == f"server: live: session s at {server.address.replace('http', 'ws')}/api/v1/ingest"
    )
    assert [m.seq for m in server.stored["r"]] == list(range(1000))
    assert len(list(tmp_path.glob("0*.ndjson"))) == 1


def test_a_line_is_sent_exactly_as_it_was_spooled(spool, server, tmp_path):
    fill(spool, 3)
    spooled = (tmp_path / "000000000000.ndjson").read_text().splitlines()
    run(spool, server.address)
    assert server.lines["r"] == spooled[1:]


@pytest.mark.parametrize("faults", [{"drop_after": 100}, {"lose": 50}, {"drop_after": 300, "lose": 200}])
def test_what_was_not_acknowledged_is_sent_again(spool, server, faults):
    vars(server).update(faults)
    fill(spool, 1000)
    said = run(spool, server.address)
    assert [m.seq for m in server.stored["r"]] == list(range(1000))
    assert said.count("server: lost") == len(faults)


def test_a_server_that_acknowledges_nothing_is_stale_then_asked_again_and_memory_stays_bounded(
    spool, server, monkeypatch
):
    monkeypatch.setattr(module, "STALE_AFTER", 0.1)
    server.silent = True
    fill(spool, 3 * WINDOW)
    said = run(spool, server.address, until=lambda said: said.count("server: live") == 2)
    assert "server: stale: no acknowledgement for 0 s" in said
    assert len(server.stored["r"]) <= 2 * WINDOW, "no more than a window on each of two connections"
    server.silent = False
    run(spool, server.address)
    assert [m.seq for m in server.stored["r"]] == list(range(3 * WINDOW))


def test_a_server_that_restarts_is_found_again(spool, server, make_server):
    fill(spool, 10)
    port, server.port = server.port, 1
    with make_server() as other:
        address, recorded = other.address, other
        run(spool, address)
    assert len(recorded.stored["r"]) == 10
    fill(spool, 5)
    assert "Connect call failed" in run(spool, address, until=lambda said: "searching" in said)
    with make_server(recorded):
        run(spool, address)
    assert [m.seq for m in recorded.stored["r"]] == list(range(15))
    server.port = port


def test_a_refusal_is_told_with_the_servers_words(spool, server):
    server.refusal = ErrorMessage(code="version", message="this server speaks version 2")
    said = run(spool, server.address, until=lambda said: "this server" in said)
    assert "server: searching: the server says version: this server speaks version 2" in said
    server.refusal = None
    run(spool, server.address)


def test_a_server_that_has_more_than_the_spool_is_not_written_to(spool, server, tmp_path):
    fill(spool, 10)
    run(spool, server.address)
    old_copy = Spool(tmp_path / "copy", HELLO)
    fill(old_copy, 4)
    said = run(old_copy, server.address, until=lambda said: "searching" in said)
    assert "has 10 messages of recording r" in said
    assert "only 4" in said
    assert len(server.stored["r"]) == 10
    old_copy.close()


def test_a_server_that_lost_what_it_acknowledged_is_told_so(spool, server):
    fill(spool, 200)
    run(spool, server.address)
    server.stored["r"] = []
    assert "wants message 0 again, which it had acknowledged" in run(
        spool, server.address, until=lambda said: "searching" in said
    )


def test_the_token_goes_with_every_connection(spool, server):
    fill(spool, 1)
    run(spool, server.address, token="secret")
    assert [h["Authorization"] for h in server.headers] == ["Bearer secret"]


@pytest.mark.parametrize(
    ("typed", "url"),
    [
        ("http://h:8000", "ws://h:8000/api/v1/ingest"),
        ("https://h/", "wss://h/api/v1/ingest"),
        ("h:8000", "ws://h:8000/api/v1/ingest"),
        ("wss://h/tracemesh", "wss://h/tracemesh/api/v1/ingest"),
        ("ws://h/api/v1/ingest", "ws://h/api/v1/ingest"),
    ],
)
def test_addresses_as_people_type_them(typed, url):
    assert ingest_url(typed) == url


@pytest.mark.parametrize("typed", ["ftp://h", "http://", ""])
def test_an_address_that_is_none_is_refused(typed):
    with pytest.raises(BridgeError, match="wanted a server's address"):
        ingest_url(typed)


def test_a_network_that_swallows_everything_is_noticed_and_nothing_is_lost(spool, server, monkeypatch, new_cable):
    monkeypatch.setattr(module, "PING_INTERVAL", 0.1)
    monkeypatch.setattr(module, "PING_TIMEOUT", 0.2)
    monkeypatch.setattr(module, "OPEN_TIMEOUT", 0.5)
    cable = new_cable(server.port)
    fill(spool, 50)

    def cut_and_mend(said):
        if "server: live" in said and not cable.cut and spool.next_seq == 50:
            cable.cut = True
            fill(spool, 500)
        if "server: searching" in said or "server: lost" in said:
            cable.cut = False
        return len(server.stored.get("r", ())) == 550

    said = run(spool, cable.address, until=cut_and_mend)
    assert "server: lost: the connection broke" in said
    assert [m.seq for m in server.stored["r"]] == list(range(550))
