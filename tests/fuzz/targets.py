"""What is fuzzed: parsers of what comes from outside. Each target takes any bytes and raises only when a law is broken.

Errors for people (TracemeshError, FrameError) are answers; anything else that is raised is a fault of the parser.
"""

import json
from collections.abc import Callable

import numpy as np
from pydantic import BaseModel

from tests.fuzz.device_targets import array, mrider, phyphox, sensorlogger, sensorserver
from tracemesh.api.live.meter import Meter
from tracemesh.api.live.tracker import Accepted, SessionTracker
from tracemesh.errors import TracemeshError
from tracemesh.formats.calibrations import corrections, read_calibration, write_calibration
from tracemesh.formats.meshes import read_mesh
from tracemesh.formats.networks import read_network, write_network
from tracemesh.formats.rawnet import read_rawnet, write_rawnet
from tracemesh.formats.recordings import read_recording, scan_from_recordings, write_recording
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Device, Samples
from tracemesh_bridge.errors import FrameError
from tracemesh_bridge.framing import FrameLayout, decode, encode


def rawnet(data: bytes) -> None:
    """What was read and written is read as the same again."""
    try:
        scan = read_rawnet(data.decode("utf-8", "replace"), "fuzz")
    except TracemeshError:
        return
    text = write_rawnet(scan)
    assert write_rawnet(read_rawnet(text)) == text


def network(data: bytes) -> None:
    """What was written is read with the same bits."""
    try:
        found = read_network(data.decode("utf-8", "replace"), "fuzz")
    except TracemeshError:
        return
    again = read_network(write_network(found))
    assert again.points.tobytes() == found.points.tobytes()
    assert again.normals.tobytes() == found.normals.tobytes()
    assert [s.points.tolist() for s in again.segments] == [s.points.tolist() for s in found.segments]


def recording(data: bytes) -> None:
    """What was written is read as the same; a scan holds finite numbers, marks within it, and one row per sample."""
    try:
        found = read_recording(data.decode("utf-8", "replace").split("\n"), "fuzz")
    except TracemeshError:
        return
    assert read_recording(write_recording(found).split("\n")) == found
    try:
        scan = scan_from_recordings([found])
    except TracemeshError:
        return
    for curve in scan.curves:
        count = len(curve.distance)
        assert curve.tangent.shape == curve.normal.shape == (count, 3)
        assert all(np.isfinite(column).all() for column in (curve.distance, curve.tangent, curve.normal))
        assert (curve.node_samples < count).all()


def frame(data: bytes) -> None:
    """What is decoded is encoded as the bytes that it came from, but for those of which nobody knows the meaning."""
    layout = FrameLayout()
    try:
        found = decode(layout, data)
    except FrameError:
        return
    again = encode(layout, found)
    assert decode(layout, again) == found
    assert all(again[i] == data[i] for i in range(layout.length) if i not in layout.unknown)


def calibration(data: bytes) -> None:
    """What was written is read as the same; what it corrects stays finite."""
    try:
        found = read_calibration(data.decode("utf-8", "replace"), "fuzz")
    except TracemeshError:
        return
    assert read_calibration(write_calibration(found)) == found
    device = Device(id=found.device, kind="k", calibration=found)
    for correct in corrections(device).values():
        assert correct(np.array([[0.0, 0.0, 9.81]])).shape == (1, 3)


def mesh(data: bytes) -> None:
    """In whatever format it is: finite vertices, and triangles of vertices that there are."""
    for extension in ("obj", "ply", "stl", "glb"):
        try:
            vertices, faces = read_mesh(data, extension, "fuzz")
        except TracemeshError:
            continue
        assert vertices.shape[1:] == faces.shape[1:] == (3,)
        assert np.isfinite(vertices).all()
        assert 0 <= faces.min() <= faces.max() < len(vertices)


def live(data: bytes) -> None:
    """A recording as somebody watches it: drawn and told of in numbers that browsers read."""
    try:
        found = read_recording(data.decode("utf-8", "replace").split("\n"), "fuzz")
    except TracemeshError:
        return
    tracker, meter = SessionTracker(), Meter(found.hello)
    for message in found.messages:
        if isinstance(message, Samples):
            meter.add(message)
        if not isinstance(message, ArrayReading):
            for change in tracker.take([Accepted(0, found.hello.device, message.curve, message)]):
                _told(change)
    _told(meter.read())


def _told(message: BaseModel) -> None:
    told = json.loads(message.model_dump_json())
    assert type(message).model_validate(told).model_dump_json() == message.model_dump_json()


FILES = (rawnet, network, recording, frame, calibration, mesh, live)
DEVICES = (sensorserver, sensorlogger, phyphox, array, mrider)
TARGETS: dict[str, Callable[[bytes], None]] = {target.__name__: target for target in (*FILES, *DEVICES)}
