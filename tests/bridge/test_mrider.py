import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracemesh.formats.recordings import read_recording, scan_from_recordings
from tracemesh.wire.device import CurveEnd, CurveStart, NodeMark, Samples, from_device
from tracemesh_bridge.cli import main
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.mrider import read_mrider, turned

FACES = [Rotation.identity(), *(Rotation.from_euler(a, s * 90, degrees=True) for a in "xy" for s in (-1, 1))]
FACES.append(Rotation.from_euler("x", 180, degrees=True))
POSES = [Rotation.from_euler("z", h, degrees=True) * f for f in FACES for h in (0, 90, 180, 270)]


def line(pose, time=1498651234567, transposed=True):
    """What the app writes in a pose: a rotation from the phone's axes to ENU."""
    matrix = pose.as_matrix().T if transposed else pose.as_matrix()
    return f"{time:16d}  " + "  ".join(f"{v:+8.6f}" for v in (*matrix[:, 1], *matrix[:, 2]))


def network(*curves):
    return ["MORPHORIDER NETWORK", *(line for curve in curves for line in curve)]


def messages(lines, **options):
    return [from_device.validate_json(text) for text in read_mrider(lines, "r", **{"transposed": True, **options})]


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("transposed", [True, False])
def test_pose(pose, transposed):
    lines = network(["CURVE 1 0", "SEGMENT", line(pose, transposed=transposed)])
    (samples,) = (m for m in messages(lines, transposed=transposed) if isinstance(m, Samples))
    assert np.allclose(samples.tangent[0], pose.as_matrix()[:, 1], atol=1e-6)
    assert np.allclose(samples.normal[0], pose.as_matrix()[:, 2], atol=1e-6)


def test_the_trap_a_flat_phone_with_its_top_to_the_west():
    assert turned((1, 0, 0), (0, 0, 1)) == ((-1, 0, 0), (0, 0, 1))


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_turning_twice_turns_nothing(a, b, c):
    matrix = Rotation.from_rotvec([a, b, c]).as_matrix()
    assert np.allclose(turned(*turned(matrix[:, 1], matrix[:, 2])), (matrix[:, 1], matrix[:, 2]), atol=1e-12)


FLAT = Rotation.identity()
TWO = network(
    ["CURVE  1  0", "SEGMENT", line(FLAT, 1000), line(FLAT, 1020), "SEGMENT", line(FLAT, 1040), line(FLAT, 1060)],
    ["", "CURVE 0 1", "SEGMENT", line(FLAT, 2000), line(FLAT, 2020)],
    ["CURVE 1 0", "SEGMENT"],
)


def test_curves_samples_and_nodes():
    read = messages(TWO)
    assert [m.seq for m in read[1:]] == list(range(len(read) - 1))
    assert [m.boundary for m in read if isinstance(m, CurveStart)] == [True, False]
    assert [m.closed for m in read if isinstance(m, CurveEnd)] == [False, True]
    assert [m.time for m in read if isinstance(m, Samples)] == [[1.0, 1.02, 1.04, 1.06], [2.0, 2.02]]
    marks = [(m.curve, m.sample, m.node) for m in read if isinstance(m, NodeMark)]
    assert marks == [(0, 0, 0), (0, 2, 1), (0, 3, 2), (1, 0, 3), (1, 1, 4)]


def test_node_numbers_that_are_given():
    marks = [m.node for m in messages(TWO, nodes=[[5, 6, 5]]) if isinstance(m, NodeMark)]
    assert marks == [5, 6, 5, 7, 8]
    with pytest.raises(BridgeError, match="curve 0: wanted numbers for its 3 nodes, got 2"):
        messages(TWO, nodes=[[5, 6]])
    with pytest.raises(BridgeError, match="at most 2 curves, got 3"):
        messages(TWO, nodes=[[1, 2, 3], [1, 2], [1]])


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "line 1: wanted MORPHORIDER NETWORK, got 'nothing'"),
        (["MORPHORIDER"], "line 1: wanted MORPHORIDER NETWORK, got 'MORPHORIDER'"),
        (network(["SEGMENT"]), "line 2: wanted CURVE, got 'SEGMENT'"),
        (network(["CURVE 2 0"]), "line 2: wanted CURVE and two of 0 or 1"),
        (network(["CURVE 1 0", "1 2 3"]), "line 3: wanted a time in ms and two unit vectors"),
        (network(["CURVE 1 0", "1 0 2 0 0 0 1"]), "line 3: wanted a time in ms and two unit vectors"),
        (network(["CURVE 1 0", "1 0 x 0 0 0 1"]), "line 3: wanted a time in ms and two unit vectors"),
        (network(["CURVE 1 0", "nan 0 1 0 0 0 1"]), "line 3: wanted a time in ms and two unit vectors"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(lines, words):
    with pytest.raises(BridgeError, match=words):
        messages(lines)


@given(st.lists(st.text(max_size=30) | st.sampled_from(TWO), max_size=12))
def test_any_lines_are_read_or_refused(lines):
    try:
        messages(["MORPHORIDER NETWORK", *lines])
    except BridgeError as error:
        assert "line " in str(error)


def test_the_command_writes_a_recording_that_is_a_scan(tmp_path, capsys):
    file = tmp_path / "mrider.txt"
    quarter = [Rotation.from_euler("z", -a, degrees=True) for a in range(0, 91, 5)]
    samples = [line(pose, 1000 + 20 * n) for n, pose in enumerate(quarter)]
    file.write_text("\n".join(network(["CURVE 1 0", "SEGMENT", *samples])))
    assert main(["mrider", str(file), "--nodes", "0,1"]) == 0
    scan = scan_from_recordings([read_recording(capsys.readouterr().out.splitlines())])
    assert np.allclose(scan.curves[0].tangent[0], (0, 1, 0), atol=1e-6)
    assert np.allclose(scan.curves[0].tangent[-1], (1, 0, 0), atol=1e-6), "from North to East is clockwise"
    assert math.isclose(float(scan.curves[0].normal[:, 2].min()), 1.0, abs_tol=1e-6)
    assert main(["mrider", str(tmp_path / "none")]) == 1
