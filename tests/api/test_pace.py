"""One device that sends as fast as it can leaves room for the others."""

import json
import threading
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed

from tracemesh.api.pace import BURST, UNIT, Pace

SIZES = st.lists(st.tuples(st.integers(0, 10 * UNIT), st.floats(0.0, 0.5)), min_size=1, max_size=50)


@given(st.integers(1, 1000), SIZES)
def test_whoever_waits_as_told_never_exceeds_the_rate_and_a_burst(rate: int, reads: list[tuple[int, float]]) -> None:
    now = 0.0
    pace = Pace(rate, lambda: now)
    taken: list[tuple[float, int]] = []
    for size, idle in reads:
        now += idle
        taken.append((now, 1 + size // UNIT))
        now += pace.take(size)
    for first, (start, _) in enumerate(taken):
        before = 0
        for end, units in taken[first:]:
            assert before <= rate * (end - start + BURST) + 1e-6
            before += units


@given(st.integers(1, 1000), st.integers(1, 100))
def test_whoever_keeps_below_the_rate_never_waits(rate: int, count: int) -> None:
    now = 0.0
    pace = Pace(rate, lambda: now)
    for _ in range(count):
        now += 1.0 / rate
        assert pace.take(UNIT - 1) == 0.0


def test_a_flood_does_not_keep_others_from_being_acknowledged(start_server: Any, ride_at: Any, line: Any) -> None:
    """The flood would take twenty seconds; the other device is through long before, and nothing is refused."""
    server = start_server(max_device_rate=100)
    flooding, polite = ride_at(server, "flood", server.new_session()), ride_at(server, "polite", server.new_session())
    messages = line(2100, block=1)
    flood = threading.Thread(target=_send_all, args=(flooding, messages))
    flood.start()
    for message in line(30, block=1):
        polite.send(message)
        polite.wait_for_ack(message["seq"])
    taken = server.http.get(f"/sessions/{flooding.welcome['session']}/recordings/flood").text.splitlines()[1:]
    assert len(taken) < len(messages)
    assert [json.loads(text)["seq"] for text in taken] == list(range(len(taken)))
    flooding.socket.close()
    flood.join()


def _send_all(rider: Any, messages: list[dict[str, Any]]) -> None:
    try:
        for message in messages:
            rider.send(message)
    except ConnectionClosed:
        pass
