"""What is fuzzed: parsers of what comes from outside. Each target takes any bytes and raises only when a law is broken.

Errors for people (TracemeshError, FrameError) are answers; anything else that is raised is a fault of the parser.
"""

from collections.abc import Callable

import numpy as np

from tracemesh.errors import TracemeshError
from tracemesh.formats.networks import read_network, write_network
from tracemesh.formats.rawnet import read_rawnet, write_rawnet
from tracemesh.formats.recordings import read_recording, scan_from_recordings, write_recording
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


TARGETS: dict[str, Callable[[bytes], None]] = {t.__name__: t for t in (rawnet, network, recording, frame)}
