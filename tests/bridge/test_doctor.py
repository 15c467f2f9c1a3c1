from collections import Counter

import pytest

from tracemesh_bridge.cli import main
from tracemesh_bridge.doctor import check_device, check_port, check_server
from tracemesh_bridge.source import Reading


def readings(count=100, **change):
    """A healthy device that is rolled."""
    healthy = {"acceleration": (0.0, 0.001, 0.5), "magnetic": (0.25, 0.0, -0.43)}
    return [
        Reading(received=0.01 * n, **{"ticks": (0, n), **healthy, "acceleration": (0.0001 * n, 0.0, 0.5), **change})
        for n in range(count)
    ]


def advice(readings, faults=(), seconds=1.0):
    return [f"{f.what}: {f.advice}" for f in check_device(readings, Counter(dict(faults)), seconds) if f.advice]


def test_a_healthy_device_needs_no_advice():
    assert advice(readings()) == []


def test_a_few_readings_of_pure_chance_are_no_iron():
    chance = [
        Reading(received=1.0, ticks=(0, n), acceleration=(0.0, 0.5, 0.0), magnetic=(0.0, 0.5, 0.0)) for n in range(2)
    ]
    assert advice(readings(200) + chance, seconds=2.0) == []


@pytest.mark.parametrize(
    ("sick", "faults", "seconds", "words"),
    [
        ([], {"late": 20}, 5.0, "does not answer: is it switched on"),
        ([], {"implausible": 20}, 5.0, "another firmware"),
        (readings(), {}, 10.0, "10 samples per second: bring it nearer"),
        (readings(), {"short": 30}, 1.0, "faults in 130 answers: 30 short: bring the device nearer"),
        (readings(acceleration=(0.0, 0.0, 0.5)), {}, 1.0, "every answer is the same"),
        (readings(ticks=(3, 3)), {}, 1.0, "the wheel did not turn: roll the device"),
        (readings(magnetic=(1.0, 0.0, -0.4)), {}, 1.0, "magnetometer: 100 of 100 readings are at the end"),
        (readings(50) + readings(50, magnetic=(0.5, 0.0, -0.86)), {}, 1.0, "there is iron or a magnet near"),
        (readings(50) + readings(50, magnetic=(0.43, 0.0, -0.25)), {}, 1.0, "there is iron or a magnet near"),
    ],
)
def test_each_illness_is_told_by_its_own_words(sick, faults, seconds, words):
    (told,) = advice(sick, faults, seconds)
    assert words in told


def test_a_port_that_is_not_there(tmp_path):
    assert "rfcomm bind" in check_port(str(tmp_path / "rfcomm*")).advice


def test_a_port_that_may_not_be_opened(tmp_path, monkeypatch):
    (tmp_path / "port").touch()
    monkeypatch.setattr("os.access", lambda *_: False)
    assert "usermod -aG" in check_port(str(tmp_path / "port")).advice


def test_a_server_that_is_not_there_or_takes_no_recordings(server):
    assert check_server(server.address).advice == ""
    assert "tracemesh serve" in check_server("http://127.0.0.1:1").advice


def test_the_command_examines_a_real_port(bench, server, capsys):
    bench.virtual("--pace", "clock", "--speed", "4", "--noise", "0.2")
    port = str(bench.folder / "rider")
    status = main(["doctor", "--port", port, "--seconds", "3", "--server", server.address, "--timeout", "1"])
    told = capsys.readouterr().out
    assert status == 0, told
    assert told.count("  ok  ") == 7
    assert main(["doctor", "--port", port + "-no"]) == 1
