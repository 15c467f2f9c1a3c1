"""Recordings: reading undoes writing, every kind of device gives the same scan, faults are named."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracemesh.errors import InputError, ScanError, TracemeshError
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import (
    Recording,
    read_recording,
    recording_from_scan,
    recording_from_simulation,
    scan_from_recordings,
    write_recording,
)
from tracemesh.geometry.simulated.shapes import SHAPES, leaf
from tracemesh.geometry.simulated.simulation import Imperfections, plan_scan, simulate_scan
from tracemesh.wire.device import CurveEnd, CurveStart, Device, Hello, NodeMark, Recorded, Samples, Wheel

WHEEL = Wheel(circumference=0.1, ticks_per_turn=500)


def hello(**device: object) -> Hello:
    return Hello(recording="r", device=Device.model_validate({"id": "d", "kind": "phone"} | device))


def recording(*messages: Recorded, **device: object) -> Recording:
    numbered = [m.model_copy(update={"seq": seq}) for seq, m in enumerate(messages)]
    return Recording(hello(**device), numbered)


def curve(*inner: Recorded, boundary: bool = False, closed: bool = False) -> list[Recorded]:
    return [CurveStart(seq=0, curve=0, boundary=boundary), *inner, CurveEnd(seq=0, curve=0, closed=closed)]


def quaternions(count: int, first: int = 0, **columns: object) -> Samples:
    """A turn about the vertical, one hundredth of a revolution per sample."""
    half = np.pi * (first + np.arange(count)) / 100
    rows = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)]).tolist()
    data = {
        "seq": 0,
        "curve": 0,
        "first_sample": first,
        "quaternion": rows,
        "distance": [*map(float, range(first, first + count))],
    }
    return Samples.model_validate({k: v for k, v in (data | columns).items() if v is not None})


def mark(sample: int, node: int, undo: bool = False) -> NodeMark:
    return NodeMark(seq=0, curve=0, sample=sample, node=node, undo=undo)


def test_reading_undoes_writing() -> None:
    simulated = recording_from_simulation(simulate_scan(plan_scan(leaf())), "leaf")
    assert read_recording(write_recording(simulated).splitlines()) == simulated


def test_a_rawnet_survives_the_way_through_a_recording(shared_data: Path) -> None:
    scan = read_rawnet((shared_data / "lilium.rawnet").read_text())
    text = write_recording(recording_from_scan(scan, "lilium"))
    again = scan_from_recordings([read_recording(text.splitlines())])
    for one, two in zip(scan.curves, again.curves, strict=True):
        for name in ("distance", "tangent", "normal", "node_samples", "node_ids"):
            assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
        assert (one.boundary, one.closed) == (two.boundary, two.closed)


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_ticks_and_vectors_of_a_perfect_device_give_the_exact_frames(name: str) -> None:
    plan = plan_scan(SHAPES[name](), imperfections=Imperfections().scaled(0.0))
    scan = scan_from_recordings([recording_from_simulation(simulate_scan(plan), name)])
    for measured, true in zip(scan.curves, plan.curves, strict=True):
        np.testing.assert_allclose(measured.distance[measured.node_samples], true.node_positions, atol=3e-4)
        frames = true.at(measured.distance)[1]
        np.testing.assert_allclose(measured.tangent, frames[:, :, 0], atol=0.01)
        np.testing.assert_allclose(measured.normal, frames[:, :, 1], atol=0.01)


def test_a_mounting_turns_the_devices_axes_into_the_frame() -> None:
    mounting = Rotation.from_euler("xyz", [0.3, -0.5, 1.1])
    frames = Rotation.random(20, rng=1)
    device = (frames * mounting.inv()).as_quat(scalar_first=True).tolist()
    block = Samples(seq=0, curve=0, first_sample=0, quaternion=device, distance=[0.1 * i for i in range(20)])
    scan = scan_from_recordings([recording(*curve(block), mounting=tuple(mounting.as_quat(scalar_first=True)))])
    np.testing.assert_allclose(scan.curves[0].tangent, frames.as_matrix()[:, :, 0], atol=1e-12)
    np.testing.assert_allclose(scan.curves[0].normal, frames.as_matrix()[:, :, 1], atol=1e-12)


def test_a_mounting_may_be_rounded_but_is_a_rotation() -> None:
    exact, rounded = (
        scan_from_recordings([recording(*curve(quaternions(5)), mounting=(r, r, 0.0, 0.0))]).curves[0]
        for r in (0.5**0.5, 0.7071)
    )
    np.testing.assert_allclose(rounded.normal, exact.normal, atol=1e-12)
    with pytest.raises(ValueError, match="quaternion of length 1"):
        hello(mounting=(0.5, 1e11, 0.5, 0.5))


@pytest.mark.parametrize(
    ("column", "value"),
    [("distance", 1e13), ("time", -1e13), ("acceleration", [0, 0, 1e13]), ("ticks", [2**31, 0])],
)
def test_what_is_no_measurement_is_refused_where_it_is(column: str, value: object) -> None:
    columns = {"acceleration": [[0, 0, 1]], "magnetic": [[0, 1, -1]], column: [value]}
    lines = [
        json.dumps({"type": "hello", "recording": "r", "device": {"id": "d", "kind": "k", "wheel": {}}}),
        json.dumps({"type": "curve.start", "seq": 0, "curve": 0}),
        json.dumps({"type": "samples", "seq": 1, "curve": 0, "first_sample": 0, **columns}),
    ]
    with pytest.raises(InputError, match=rf"ride.ndjson: line 3: .*{column}.* (less|greater) than or equal"):
        read_recording(lines, "ride.ndjson")


def test_vectors_whose_length_cannot_be_told_are_refused() -> None:
    block = Samples(
        seq=0, curve=0, first_sample=0, distance=[0.0, 1.0], acceleration=[(0, 0, 1), (0, 0, 1e-200)],
        magnetic=[(0, 1, -1)] * 2,
    )  # fmt: skip
    with pytest.raises(ScanError, match="acceleration: sample 2"):
        scan_from_recordings([recording(*curve(block))])


def test_a_gyroscope_is_fused_with_the_vectors() -> None:
    count = 120
    turn = Rotation.from_rotvec(np.linspace(0, 1, count)[:, None] * [0.0, 0.0, 1.0])
    shake = 4.0 * np.sin(np.linspace(0, 60, count))[:, None] * [1.0, 0.0, 0.0]
    columns = {
        "time": (np.arange(count) / 60).tolist(),
        "rotation_rate": np.tile([0.0, 0.0, 60 / (count - 1)], (count, 1)).tolist(),
        "acceleration": turn.inv().apply(np.add(shake, [0.0, 0.0, 9.81])).tolist(),
        "magnetic": turn.inv().apply([0.0, 22.0, -42.0]).tolist(),
    }
    errors = []
    for used in (columns, {k: v for k, v in columns.items() if k != "rotation_rate"}):
        block = Samples.model_validate({"seq": 0, "curve": 0, "first_sample": 0, **used})
        scan = scan_from_recordings([recording(*curve(block), reference={"magnetic": [0.0, 22.0, -42.0]})]).curves[0]
        errors.append(np.linalg.norm(scan.tangent - turn.as_matrix()[:, :, 0], axis=1).max())
    assert errors[0] < 0.05 < errors[1]


def test_a_quaternion_and_its_negative_are_the_same_orientation() -> None:
    plain = quaternions(10)
    assert plain.quaternion is not None
    flipped = plain.model_copy(
        update={"quaternion": [tuple((-1) ** i * v for v in q) for i, q in enumerate(plain.quaternion)]}
    )
    one, two = (scan_from_recordings([recording(*curve(block))]).curves[0] for block in (plain, flipped))
    np.testing.assert_allclose(one.tangent, two.tangent, atol=1e-15)


def test_blocks_are_joined_and_recordings_follow_each_other() -> None:
    two = [recording(*curve(quaternions(10), quaternions(5, 10), mark(2, 7), mark(12, 8), boundary=True)) for _ in "ab"]
    scan = scan_from_recordings(two)
    assert len(scan.curves) == 2
    assert scan.curves[1].distance.tolist() == [*map(float, range(15))]
    assert scan.curves[0].node_samples.tolist() == [2, 12]
    assert scan.curves[0].boundary


def test_undone_marks_and_discarded_curves_are_left_out() -> None:
    kept = recording(*curve(quaternions(10), mark(2, 7), mark(3, 7), mark(3, 7, undo=True)))
    assert scan_from_recordings([kept]).curves[0].node_samples.tolist() == [2]
    dropped = [*kept.messages[:-1], CurveEnd(seq=9, curve=0, discard=True)]
    assert scan_from_recordings([Recording(hello(), dropped)]).curves == ()


def test_a_curve_that_is_still_being_scanned_is_part_of_the_scan() -> None:
    assert len(scan_from_recordings([Recording(hello(), recording(*curve(quaternions(10))).messages[:-1])]).curves) == 1


def test_a_closed_curve_goes_from_its_first_node_around_to_it() -> None:
    scanned = scan_from_recordings([recording(*curve(quaternions(101), mark(20, 4), mark(70, 5), closed=True))]).curves[
        0
    ]
    assert scanned.node_ids.tolist() == [4, 5, 4]
    assert scanned.node_samples.tolist() == [0, 50, 100]
    assert scanned.distance.tolist() == [*map(float, range(20, 121))]
    np.testing.assert_allclose(scanned.tangent[0], scanned.tangent[-1], atol=1e-12)
    angle = np.unwrap(np.arctan2(scanned.tangent[:, 1], scanned.tangent[:, 0]))
    np.testing.assert_allclose(np.diff(angle), 2 * np.pi / 100, atol=1e-12)


def test_without_wheel_a_steady_hand_is_assumed() -> None:
    block = quaternions(101, distance=None, time=[0.05 * i for i in range(101)])
    scanned = scan_from_recordings([recording(*curve(block, mark(0, 0), mark(100, 1)))]).curves[0]
    assert np.ptp(np.diff(scanned.distance)[2:-2]) < 1e-12
    assert scanned.distance[-1] > 0


UP = (0, 0, 1)
NO_WHEEL = quaternions(3, distance=None, ticks=[(0, i) for i in range(3)])
FAULTS: list[tuple[list[Recorded], type[Exception], str]] = [
    (curve(quaternions(5), quaternions(5, 6)), InputError, "curve 1: wanted sample 5 next, got 6"),
    (curve(quaternions(5), mark(5, 0)), InputError, "curve 1: node 0 is marked at sample 5, wanted less than 5"),
    (curve(quaternions(5), mark(3, 0), mark(3, 1)), InputError, "curve 1: sample 3 is marked as node 0 and as node 1"),
    (curve(quaternions(5), mark(3, 0, undo=True)), InputError, "nothing to undo"),
    (curve(quaternions(5))[1:], InputError, "got samples before curve.start"),
    ([*curve(quaternions(5)), quaternions(5, 5)], InputError, "got samples after curve.end"),
    (curve(quaternions(5)) * 2, InputError, "curve 1 begins twice"),
    (curve(quaternions(5, distance=None)), InputError, "curve 1: wanted ticks, distance or time"),
    (curve(NO_WHEEL), InputError, "names no wheel"),
    (curve(quaternions(2, quaternion=[(0, 0, 0, 0)] * 2)), ScanError, "curve 1: quaternion 1 is zero"),
    (curve(quaternions(1, quaternion=None, acceleration=[UP], magnetic=[UP])), ScanError, "parallel"),
    (curve(quaternions(3, distance=None, time=[0.0, 1.0, 0.5])), ScanError, "curve 1: .* clock runs backwards"),
]  # fmt: skip


@pytest.mark.parametrize(("messages", "error", "words"), FAULTS, ids=[f[2] for f in FAULTS])
def test_contradictions_name_the_curve(messages: list[Recorded], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        scan_from_recordings([recording(*messages)])


LINES = write_recording(recording(*curve(quaternions(3)), wheel=WHEEL)).splitlines()
FILE_FAULTS = {
    "nothing": ([], "got nothing"),
    "another JSON": (['{"format": "tracemesh-network"}'], "line 1: wanted a message of a recording"),
    "no hello": (LINES[1:], "line 1: wanted hello first, got curve.start"),
    "two hellos": ([LINES[0], LINES[0]], "line 2: wanted one hello"),
    "gap": ([LINES[0], LINES[1], "", LINES[3]], "line 4: wanted the message with seq 1, got 2"),
    "cut": ([*LINES[:2], LINES[2][:40]], "line 3: Invalid JSON"),
    "not a number": ([*LINES[:2], LINES[2].replace("1.0", '"one"', 1)], "line 3: samples"),
    "not finite": ([*LINES[:2], LINES[2].replace("1.0", "NaN", 1)], "line 3: "),
    "unknown type": ([LINES[0], '{"type": "sample"}'], "line 2: .*'sample'"),
}


@pytest.mark.parametrize("name", FILE_FAULTS)
def test_damaged_files_name_the_line(name: str) -> None:
    lines, words = FILE_FAULTS[name]
    with pytest.raises(InputError, match=words) as caught:
        read_recording(lines, "scan.ndjson")
    assert "scan.ndjson" in str(caught.value)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_damaged_recording_gives_a_scan_or_an_error_for_people(data: st.DataObject) -> None:
    lines = write_recording(recording(*curve(quaternions(4), quaternions(3, 4), mark(0, 7), mark(6, 8)))).splitlines()
    row = data.draw(st.integers(0, len(lines) - 1))
    at = data.draw(st.integers(0, len(lines[row])))
    junk = data.draw(st.text(alphabet='0123456789-.,:[]{}"ean', max_size=2))
    lines[row] = lines[row][:at] + junk + lines[row][at + data.draw(st.integers(0, 3)) :]
    if data.draw(st.booleans()):
        del lines[data.draw(st.integers(0, len(lines) - 1))]
    try:
        scan = scan_from_recordings([read_recording(lines, "damaged")])
    except TracemeshError:
        return
    assert all(np.isfinite(c.tangent).all() and np.isfinite(c.distance).all() for c in scan.curves)


@pytest.mark.parametrize("offset", [(0.0, 0.05, 0.0), (0.03, 0.0, 0.0), (-0.02, 0.04, 0.0)])
def test_a_wheel_beside_the_sensors_is_taken_into_account(offset: tuple[float, float, float]) -> None:
    """Once round a sphere of radius 0.5 m: what was measured behind the wheel, and on another radius."""
    angle = np.linspace(0.0, 2 * np.pi, 629)
    behind = offset[0] / 0.5
    normal, tangent = (
        np.column_stack([np.cos(a), np.sin(a), 0 * a]) for a in (angle - behind, angle - behind + np.pi / 2)
    )
    columns = {
        "tangent": tangent.tolist(),
        "normal": normal.tolist(),
        "distance": ((0.5 + offset[1]) * angle).tolist(),
    }
    block = Samples.model_validate({"seq": 0, "curve": 0, "first_sample": 0, **columns})
    wheel = {"offset": offset}
    (curve_,) = scan_from_recordings(
        [recording(*curve(block, mark(0, 0), mark(300, 1), mark(628, 0), closed=True), wheel=wheel)]
    ).curves
    np.testing.assert_allclose(curve_.distance, 0.5 * angle, atol=1e-9)
    expected = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    np.testing.assert_allclose(curve_.normal, expected, atol=1e-9)
    timed = Samples(
        seq=0, curve=0, first_sample=0, time=angle.tolist(), tangent=tangent.tolist(), normal=normal.tolist()
    )
    assert scan_from_recordings([recording(*curve(timed), wheel=wheel)]).curves[0].normal.tolist() == normal.tolist()
