"""Virtual phones, each in a process of its own that behaves as its app does, through the bridge into a real socket."""

import re
import signal
import time
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracemesh.geometry.simulated.shapes import cone
from tracemesh.wire.device import NodeMark, Samples
from tracemesh_bridge.phone import MOUNTING

RATE = 100.0


def scan(bench, app, *phone_options, samples=300):
    """Scan a part of the first curve of the cone."""
    options = ["--app", app, "--shape", "cone", "--noise", "0", "--rate", str(RATE), "--speed", "5", *phone_options]
    if app == "sensorlogger":
        bridge = bench.recording(app, "--host", "127.0.0.1", "--port", "0")
        bridge.says("waiting for the app at port")
        port = re.search(r"at port (\d+)", bridge.said)[1]
        bench.start("virtual-phone", *options, "--url", f"http://127.0.0.1:{port}")
    else:
        phone = bench.start("virtual-phone", *options)
        phone.says("virtual phone at")
        bridge = bench.recording(app, "--address", phone.said.split()[-1])
    bridge.says("device: live")
    bridge.type("+")
    bridge.says("started")
    wait_for(lambda: len(column(bench.server, "time")) >= samples)
    bridge.type("7\n.q")
    assert bridge.wait() == 0
    assert bridge.said.count("device: live") == 1


def wait_for(condition):
    while not condition():
        time.sleep(0.02)


def column(server, name):
    return [v for m in server.messages if isinstance(m, Samples) for v in getattr(m, name)] if server.stored else []


@pytest.mark.parametrize("app", ["sensorserver", "sensorlogger", "phyphox"])
def test_every_sample_is_stored_once_and_in_order_and_is_a_frame_of_the_surface(bench, app):
    scan(bench, app)
    assert np.allclose(np.diff(column(bench.server, "time")), 1 / RATE, atol=1e-4), "no sample missing, none twice"
    assert [m.node for m in bench.server.messages if isinstance(m, NodeMark)] == [7]
    assert bench.server.hellos[0].device.mounting == MOUNTING
    mounting = Rotation.from_quat(MOUNTING, scalar_first=True)
    frames = Rotation.from_quat(column(bench.server, "quaternion"), scalar_first=True) * mounting
    curve = cone().curves[0]
    exact = Rotation.from_matrix(curve.at(np.linspace(0, curve.length, 400))[1])
    assert max((exact.inv() * f).magnitude().min() for f in frames) < 0.02


def test_posts_that_come_twice_and_out_of_order_are_stored_once_and_in_order(bench):
    scan(bench, "sensorlogger", "--repeat", "0.3", "--reorder", "0.3", "--seed", "3", samples=1000)
    assert np.allclose(np.diff(column(bench.server, "time")), 1 / RATE, atol=1e-4)


@pytest.mark.parametrize("jump", ["3600", "-3600"])
def test_a_clock_that_is_set_during_the_ride_costs_no_sample_and_no_time(bench, jump):
    scan(bench, "sensorserver", "--clock-jump", jump, samples=1200)
    steps = np.diff(column(bench.server, "time"))
    assert np.sum(~np.isclose(steps, 1 / RATE, atol=1e-4)) <= 1
    assert steps.min() > 0
    assert steps.max() < 1.0


def test_a_phone_that_vanishes_is_found_again(bench):
    options = ["virtual-phone", "--app", "sensorserver", "--rate", "50"]
    phone = bench.start(*options)
    phone.says("virtual phone at")
    address = phone.said.split()[-1]
    bridge = bench.recording("sensorserver", "--address", address)
    bridge.says("device: live")
    phone.stop(signal.SIGKILL)
    bridge.says("device: lost: the connection broke")
    again = bench.start(*options, "--port", address.split(":")[-1])
    again.says("virtual phone at")
    bridge.type("-")
    bridge.says("curve 0 (boundary) started")
    wait_for(lambda: bridge.said.count("device: live") == 2)
    bridge.type("q")
    assert bridge.wait() == 0
    assert bridge.said.count("device: lost") == 1


def test_what_the_user_must_change_in_the_app_is_answered_with_status_499(bench):
    bridge = bench.recording("sensorlogger", "--host", "127.0.0.1", "--port", "0")
    bridge.says("waiting for the app at port")
    url = f"http://127.0.0.1:{re.search(r'at port ([0-9]+)', bridge.said)[1]}"
    for body, words in (
        (b"hello", "wanted a message of Sensor Logger"),
        (message("a", "gyroscope"), "switch on the sensors gravity and orientation"),
        (message("b", "gyroscope"), "this bridge records phone a"),
    ):
        with pytest.raises(HTTPError) as refusal:
            urlopen(Request(url, body), timeout=10)
        assert refusal.value.code == 499
        assert words in refusal.value.read().decode()
        refusal.value.close()
    with urlopen(url, timeout=10) as answer:
        assert "give this address to Sensor Logger" in answer.read().decode()
    bridge.type("q")
    assert bridge.wait() == 0


def message(phone, sensor):
    return (
        f'{{"messageId":0,"sessionId":"s","deviceId":"{phone}",'
        f'"payload":[{{"name":"{sensor}","time":1,"values":{{"x":0,"y":0,"z":0}}}}]}}'
    ).encode()
