"""What every phone adapter must get right: the pose, the clock, the sign of gravity, and whatever garbage it is sent.

A pose is a rotation from the device's axes (x right, y to the top, z out of the screen) to ENU: one of six faces up, in
one of four headings. Each adapter is given the pose in its app's own words.
"""

import json
import math
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracemesh.formats.recordings import Recording, scan_from_recordings
from tracemesh.wire.device import CurveStart, Device, Hello, Samples
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.health import Health, Host
from tracemesh_bridge.phone import MOUNTING, Assembler, SteadyTime
from tracemesh_bridge.pose import AGREEING, PoseCheck, turn, unit, verdict
from tracemesh_bridge.source import Link
from tracemesh_bridge.sources import phyphox
from tracemesh_bridge.sources.phyphox import Input, find_inputs, parse_rows, parse_status, query
from tracemesh_bridge.sources.sensorlogger import Translator
from tracemesh_bridge.sources.sensorlogger_batches import MOST_AHEAD, PATIENCE, Batch, Reorder, parse_batch
from tracemesh_bridge.sources.sensorserver import SensorServer, SensorServerSettings, parse_event, sensor_url

DEVICE = Device(id="phone", kind="phone")
FACES = {
    "back": Rotation.identity(),
    "screen down": Rotation.from_euler("x", 180, degrees=True),
    "standing": Rotation.from_euler("x", 90, degrees=True),
    "on its head": Rotation.from_euler("x", -90, degrees=True),
    "left side": Rotation.from_euler("y", -90, degrees=True),
    "right side": Rotation.from_euler("y", 90, degrees=True),
}
POSES = {
    f"{face}, turned {heading}": Rotation.from_euler("z", heading, degrees=True) * rotation
    for face, rotation in FACES.items()
    for heading in (0, 90, 180, 270)
}
ENU_TO_NORTH_WEST_UP = Rotation.from_matrix([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])


@pytest.fixture(params=POSES)
def pose(request):
    return POSES[request.param]


@pytest.fixture
def said():
    return []


@pytest.fixture
def host(said):
    return Host(Link("device", said.append))


def is_pose(reading, pose):
    turned = [turn(reading.quaternion, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    assert np.allclose(np.transpose(turned), pose.as_matrix(), atol=1e-6)
    assert np.allclose(turn(reading.quaternion, reading.acceleration), (0, 0, 9.81), atol=1e-6)


def gravity(pose):
    """Specific force at rest in the device's axes, m/s^2."""
    return [float(v) for v in pose.inv().apply([0, 0, 9.81])]


def test_the_top_points_west_when_a_flat_phone_is_turned_by_90_degrees():
    w = x = math.sqrt(0.5)
    assert np.allclose(turn((w, 0, 0, x), (0, 1, 0)), (-1, 0, 0))


def test_the_usual_mounting_moves_a_phone_towards_its_top_with_the_screen_outwards():
    assert np.allclose(turn(MOUNTING, (1, 0, 0)), (0, 1, 0)), "t is y"
    assert np.allclose(turn(MOUNTING, (0, 1, 0)), (0, 0, 1)), "N is z"


# SensorServer


def event(sensor, values, time=5_000_000_000):
    return json.dumps({"type": f"android.sensor.{sensor}", "values": values, "timestamp": time, "accuracy": 3})


def test_sensorserver_pose(pose, host):
    source = SensorServer(SensorServerSettings("h:8080"), DEVICE, host)
    source.take(event("accelerometer", gravity(pose)))
    reading = source.take(event("rotation_vector", [*pose.as_quat().tolist(), 0.1]))
    is_pose(reading, pose)
    assert reading.time == 5.0


def test_sensorserver_raw_streams_are_fused_into_the_pose(pose, host):
    """Two seconds at rest, seen through the whole way from the app's events to the frames of the scan."""
    source = SensorServer(
        SensorServerSettings("h:8080", ("gyroscope", "accelerometer", "magnetic_field")), DEVICE, host
    )
    field = pose.inv().apply([0.0, 20.0, -40.0]).tolist()
    readings = []
    for n in range(200):
        time = 5_000_000_000 + 10_000_000 * n
        for sensor, values in (
            ("accelerometer", gravity(pose)),
            ("magnetic_field", field),
            ("gyroscope", [0.0, 0.0, 0.0]),
        ):
            readings.append(source.take(event(sensor, values, time)))
    kept = [r for r in readings if r is not None]
    assert len(kept) == 200
    assert all(r.quaternion is None for r in kept)
    names = ("time", "acceleration", "magnetic", "rotation_rate")
    block = Samples(seq=1, curve=0, first_sample=0, **{name: [getattr(r, name) for r in kept] for name in names})
    hello = Hello(recording="r", device=DEVICE.model_copy(update={"mounting": MOUNTING}))
    (curve,) = scan_from_recordings([Recording(hello, [CurveStart(seq=0, curve=0), block])]).curves
    assert np.allclose(curve.tangent, pose.apply([0, 1, 0]), atol=0.01), "towards its top"
    assert np.allclose(curve.normal, pose.apply([0, 0, 1]), atol=0.01), "out of its screen"


def test_sensorserver_raw_streams_wait_for_all_three_and_take_none_twice(host):
    source = SensorServer(
        SensorServerSettings("h:8080", ("gyroscope", "accelerometer", "magnetic_field")), DEVICE, host
    )
    assert source.take(event("gyroscope", [0.0, 0.0, 0.1])) is None
    assert source.take(event("accelerometer", [0.0, 0.0, 9.81])) is None
    assert source.take(event("magnetic_field", [0.0, 20.0, -40.0])) is None
    assert source.take(event("gyroscope", [0.0, 0.0, 0.1])).rotation_rate == (0.0, 0.0, 0.1)
    assert source.take(event("gyroscope", [0.0, 0.0, 0.1])) is None
    assert host.health.faults["repeated"] == 1


def test_sensorserver_rotation_vector_of_three(host):
    pose = POSES["standing, turned 90"]
    quaternion = pose.as_quat(canonical=True).tolist()
    source = SensorServer(SensorServerSettings("h:8080"), DEVICE, host)
    source.take(event("accelerometer", gravity(pose)))
    is_pose(source.take(event("rotation_vector", quaternion[:3])), pose)


def test_sensorserver_has_another_address_for_one_sensor_than_for_several():
    one = SensorServerSettings("h:8080", ("rotation_vector",))
    assert sensor_url(one) == "ws://h:8080/sensor/connect?type=android.sensor.rotation_vector"
    url = sensor_url(SensorServerSettings("ws://h:8080/", ("rotation_vector", "gyroscope")))
    assert json.loads(dict(parse_qsl(urlsplit(url).query))["types"]) == [
        "android.sensor.rotation_vector", "android.sensor.gyroscope"
    ]  # fmt: skip
    with pytest.raises(BridgeError, match="wanted one of rotation_vector"):
        sensor_url(SensorServerSettings("h", ("gyroscope",)))


def test_sensorserver_event_without_a_type_is_of_the_only_sensor():
    assert parse_event('{"values":[1,2,3],"timestamp":7000000000}', "android.sensor.gyroscope").sensor == "gyroscope"


# Sensor Logger


MILLISECOND = 1_000_000


def entry(name, time, values):
    return {"name": name, "time": time, "values": values}


def logger_message(pose, apple, number=0, time=1_700_000_000_000_000_000):
    sign = -1.0 if apple else 1.0
    x, y, z = (sign * v for v in gravity(pose))
    said = ENU_TO_NORTH_WEST_UP * pose if apple else pose
    qx, qy, qz, qw = said.as_quat().tolist()
    still = {"x": 0.0, "y": 0.0, "z": 0.0}
    payload = [
        entry(
            "orientation",
            time + 30 * MILLISECOND,
            {"qx": qx, "qy": qy, "qz": qz, "qw": qw, "roll": 0, "pitch": 0, "yaw": 0},
        ),
        entry("gravity", time + 10 * MILLISECOND, {"x": x, "y": y, "z": z}),
        entry("accelerometer", time + 20 * MILLISECOND, still),
        entry("microphone", time, {"dBFS": -30}),
        entry("orientation", time + 40 * MILLISECOND, {"qx": qx, "qy": qy, "qz": qz, "qw": qw}),
        entry("accelerometer", time + 35 * MILLISECOND, still),
    ]
    return json.dumps({"messageId": number, "sessionId": "s", "deviceId": "d", "payload": payload}).encode()


@pytest.mark.parametrize("apple", [False, True], ids=["android", "ios"])
def test_sensorlogger_pose(pose, apple, host, said):
    readings = list(Translator(host).readings(parse_batch(logger_message(pose, apple), 0.0)))
    assert len(readings) == 2
    is_pose(readings[-1], pose)
    assert said == ["device: live: phone d"]


def test_sensorlogger_without_gravity_is_taken_as_it_is(host):
    pose = POSES["standing, turned 90"]
    batch = parse_batch(logger_message(pose, apple=False), 0.0)
    only = Batch(0, "s", "d", tuple(e for e in batch.entries if e.name == "orientation"), 0.0)
    reading = next(Translator(host).readings(only))
    assert np.allclose(turn(reading.quaternion, (1, 0, 0)), pose.apply((1, 0, 0)))


def batch(number, session="s", received=0.0):
    return Batch(number, session, "phone", (), received)


@given(st.permutations(range(12)), st.lists(st.integers(0, 11), max_size=10))
def test_messages_in_any_order_and_any_number_of_times_are_read_once_in_order(order, again):
    reorder = Reorder(Health())
    read = [b.number for n in [*order, *again] for b in reorder.add(batch(n))]
    assert read == list(range(12))


def test_a_missing_message_is_waited_for_but_not_for_ever():
    health = Health()
    reorder = Reorder(health)
    assert [b.number for b in reorder.add(batch(0))] == [0]
    assert reorder.add(batch(2, received=1.0)) == []
    assert reorder.late(1.0 + PATIENCE / 2) == []
    assert [b.number for b in reorder.late(1.1 + PATIENCE)] == [2]
    assert health.faults["missing"] == 1
    early = [b.number for n in range(4, 5 + MOST_AHEAD) for b in reorder.add(batch(n))]
    assert early == list(range(4, 5 + MOST_AHEAD))
    assert health.faults["missing"] == 2


def test_a_new_recording_of_the_app_counts_from_zero_again():
    reorder = Reorder(Health())
    reorder.add(batch(0))
    assert reorder.add(batch(2)) == []
    assert [(b.session, b.number) for b in reorder.add(batch(0, "t"))] == [("s", 2), ("t", 0)]
    assert [b.number for b in reorder.add(batch(500, "u"))] == [500], "the bridge was started late"


# phyphox


def phyphox_answer(pose, times, session="a1b2c3", measuring=True):
    x, y, z, w = pose.as_quat(canonical=True).tolist()
    ax, ay, az = gravity(pose)
    values = {"q_t": times, "q_w": w, "q x": x, "q_y": y, "q_z": z, "a_t": [t - 0.001 for t in times]}
    values |= {"ax": ax, "ay": ay, "az": az}
    buffers = {k: {"size": 0, "updateMode": "partial", "buffer": v if isinstance(v, list) else [v] * len(times)}
               for k, v in values.items()}  # fmt: skip
    return {"buffer": buffers, "status": {"session": session, "measuring": measuring}}


ATTITUDE = Input("attitude", ("q_t", "q_w", "q x", "q_y", "q_z"))
ACCELEROMETER = Input("accelerometer", ("a_t", "ax", "ay", "az"))
CONFIG = {
    "title": "Raw",
    "inputs": [
        {"source": "accelerometer", "outputs": [{"x": "ax"}, {"y": "ay"}, {"z": "az"}, {"t": "a_t"}]},
        {"source": "attitude", "outputs": [{"x": "q x"}, {"y": "q_y"}, {"z": "q_z"}, {"abs": "q_w"}, {"t": "q_t"}]},
        {"source": "bluetooth"},
    ],
}


def test_phyphox_pose(pose, host):
    source = phyphox.Phyphox("h", DEVICE, host)
    since = {ATTITUDE: 0.0, ACCELEROMETER: 0.0}
    readings = list(source.read(phyphox_answer(pose, [0.5, 1.0]), since, 9.0))
    assert [r.time for r in readings] == [0.5, 1.0]
    is_pose(readings[-1], pose)
    assert since == {ATTITUDE: 1.0, ACCELEROMETER: 0.999}
    assert list(source.read(phyphox_answer(pose, [0.5, 1.0]), since, 9.1)) == [], "nothing is read twice"


def test_phyphox_sensors_are_found_by_what_the_experiment_says():
    assert find_inputs(CONFIG) == (ATTITUDE, ACCELEROMETER)
    with pytest.raises(BridgeError, match="'Raw' records accelerometer"):
        find_inputs({**CONFIG, "inputs": CONFIG["inputs"][:1]})
    for wrong in (None, [], {}, {"inputs": 3}, {"inputs": [{}]}):
        with pytest.raises(BridgeError, match="description of an experiment"):
            find_inputs(wrong)


def test_phyphox_is_asked_for_what_came_since():
    asked = dict(parse_qsl(urlsplit(query({ATTITUDE: 12.5, ACCELEROMETER: float("-inf")})).query))
    assert (asked["q_t"], asked["q x"], asked["ax"]) == ("12.5", "12.5|q_t", "full")


# clock and pose


def test_a_clock_that_jumps_costs_no_time_and_turns_none_back():
    health, steady = Health(), None
    steady = SteadyTime(health)
    phone = [0.0, 0.01, 0.02, 3600.0, 3600.01, -50.0, -49.99]
    times = [steady.follow(t, 100 + 0.01 * i) for i, t in enumerate(phone)]
    assert np.allclose(np.diff(times), 0.01)
    assert health.faults["clock jump"] == 2


@given(st.lists(st.floats(0.001, 0.05), min_size=1, max_size=30), st.integers(1, 30))
def test_bursts_and_gaps_of_the_network_change_no_time(steps, burst):
    steady, times = SteadyTime(Health()), np.cumsum(steps)
    arrivals = [times[min(len(times) - 1, (i // burst + 1) * burst)] for i in range(len(times))]
    assert [steady.follow(t, r) for t, r in zip(times, arrivals, strict=True)] == list(times)


@pytest.mark.parametrize(
    ("quaternion", "force", "words"),
    [
        ((1, 0, 0, 0), (0, 0, 9.81), ""),
        ((1, 0, 0, 0), (0, 0, -9.81), "opposite sign"),
        ((math.sqrt(0.5), math.sqrt(0.5), 0, 0), (0, 9.81, 0), ""),
        ((math.sqrt(0.5), math.sqrt(0.5), 0, 0), (0, -9.81, 0), "opposite sign"),
        ((math.cos(0.5), math.sin(0.5), 0, 0), (0, -9.81 * math.sin(1), 9.81 * math.cos(1)), "other way round"),
        ((1, 0, 0, 0), (9.81, 0, 0), "contradict"),
    ],
)
def test_gravity_tells_what_is_wrong_with_a_pose(quaternion, force, words):
    assert words in verdict(quaternion, force)
    assert bool(verdict(quaternion, force)) == bool(words)


def test_a_wrong_pose_is_said_once_and_only_at_rest(said):
    check = PoseCheck(said.append)
    for _ in range(3 * AGREEING):
        check.watch((1, 0, 0, 0), (0, 0, -12.0))
    assert said == []
    for _ in range(3 * AGREEING):
        check.watch((1, 0, 0, 0), (0, 0, -9.8))
    assert said == ["its accelerations have the opposite sign: what it records will be misread"]


def test_what_is_no_rotation_or_comes_twice_is_no_reading(host):
    assembler = Assembler(host.health, lambda _: None)
    assert assembler.orient(0.0, (0, 0, 0, 0), 0.0) is None
    assert assembler.orient(0.0, (2, 0, 0, 0), 0.0).quaternion == (1, 0, 0, 0)
    assert assembler.orient(0.0, (2, 0, 0, 0), 0.1) is None
    assert host.health.faults == {"implausible": 1, "repeated": 1}


@given(st.tuples(*[st.floats(-5, 5)] * 4))
def test_a_quaternion_is_made_a_rotation_or_refused(quaternion):
    rotation = unit(quaternion)
    assert rotation is None or math.isclose(math.hypot(*rotation), 1.0)


# whatever is sent

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
        st.sampled_from(["values", "timestamp", "type", "payload", "messageId", "sessionId", "deviceId", "name", "time",
                         "buffer", "status", "session", "measuring", "q_t", "x"]), inner, max_size=6),
    max_leaves=12,
)  # fmt: skip


@given(JSON.map(lambda v: json.dumps(v).encode()) | st.binary(max_size=50))
def test_anything_is_parsed_or_refused_with_a_bridge_error(data):
    for parse in (
        lambda: parse_event(data, "only"),
        lambda: parse_batch(data, 0.0),
        lambda: parse_status(phyphox.parse(data)),
        lambda: parse_rows(phyphox.parse(data), ATTITUDE, 0.0),
        lambda: find_inputs(phyphox.parse(data)),
    ):
        try:
            parse()
        except BridgeError:
            continue
