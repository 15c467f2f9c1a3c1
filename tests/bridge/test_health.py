import math
import sys
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracemesh_bridge.health import Health, dip
from tracemesh_bridge.source import Link, LinkState, Reading


def healthy(times, **columns):
    health = Health()
    for received in times:
        health.take(Reading(received=received, **columns))
    return health


def test_rate_age_and_jitter_are_those_of_the_last_two_seconds():
    times = [100 + n / 10 for n in range(50)] + [105 + n / 50 for n in range(150)]
    health = healthy(times)
    assert health.rate(times[-1]) == pytest.approx(50, abs=0.5)
    assert health.describe(times[-1] + 0.5) == "37.5 Hz  jitter 0.0 ms  age 0.5 s"
    assert health.rate(times[-1] + 10) == 0
    assert health.received == 200


def test_jitter_is_the_deviation_of_the_gaps():
    assert "jitter 5.0 ms" in healthy([0.0, 0.015, 0.020, 0.035, 0.040]).describe(0.04)


def test_lag_is_what_a_reading_took_longer_than_the_quickest():
    health = Health()
    for time, delay in ((0.0, 3600.05), (0.1, 3600.02), (0.2, 3600.22)):
        health.take(Reading(received=time + delay, time=time))
    assert health.lag == pytest.approx(0.2)
    assert "lag 200 ms" in health.describe(3600.5)
    assert healthy([1.0]).lag is None


def test_field_strengths_and_dip_are_shown():
    shown = healthy([1.0, 2.0], acceleration=(0.0, 0.0, 2.0), magnetic=(0.5, 0.0, -(0.75**0.5))).describe(2.0)
    assert "|acc| 2  |mag| 1  dip 60.0°" in shown


def test_faults_are_shown_and_nothing_is_said_of_nothing():
    health = healthy([1.0])
    health.fault("short")
    health.fault("late")
    health.fault("late")
    assert health.describe(1.0).endswith("2 late  1 short")
    assert Health().describe(0.0) == "no sample yet"


@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(0.1, 100), st.floats(0.1, 100))
def test_dip_does_not_depend_on_units(angle, a, m):
    up, field = (0.0, 0.0, a), (m * math.cos(angle), 0.0, -m * math.sin(angle))
    assert dip(up, field) == pytest.approx(angle, abs=1e-6)


def test_a_link_says_one_line_when_it_goes_down_and_one_when_it_is_up():
    said = []
    link = Link("device", said.append)
    for _ in range(3):
        link.to(LinkState.SEARCHING, "no port")
        link.to(LinkState.OPENING, "port")
    for _ in range(3):
        link.to(LinkState.LIVE, "port")
    link.to(LinkState.STALE, "silent")
    link.to(LinkState.STALE, "silent")
    for _ in range(3):
        link.down("gone")
    link.to(LinkState.LIVE, "port")
    assert said == ["device: searching: no port", "device: live: port", "device: stale: silent",
                    "device: searching: gone", "device: live: port"]  # fmt: skip


def test_it_can_be_looked_at_while_a_source_tells_it_more():
    health, stop = Health(), threading.Event()

    def tell():
        number = 0
        while not stop.is_set():
            number += 1
            health.take(Reading(received=number / 1000, acceleration=(0, 0, 1), magnetic=(1, 0, -1)))
            health.fault(f"kind {number % 7}")

    source = threading.Thread(target=tell)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        source.start()
        while health.received < 3000:
            pass
        for _ in range(50):
            health.describe(1.0)
    finally:
        stop.set()
        source.join()
        sys.setswitchinterval(interval)
    assert sum(health.faults.values()) == health.received > 0


@pytest.mark.parametrize("size", [1e-300, 1e-200, 1e200, 1.7e308])
def test_strengths_are_told_of_any_vectors(size):
    health = Health()
    for _ in range(3):
        health.take(Reading(1.0, 1.0, acceleration=(0.0, 0.0, size), magnetic=(size / 2, 0.0, -size / 2)))
    assert f"|acc| {size:.3g}" in health.describe(1.0)
