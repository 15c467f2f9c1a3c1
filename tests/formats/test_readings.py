"""Arrays on the wire: reading undoes writing, what does not fit is named, a reading gives the shape it was made of."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from tracemesh.errors import InputError, ScanError
from tracemesh.formats.readings import reading_of, sensor_array, sensor_rotations
from tracemesh.formats.recordings import Recording, read_recording, scan_from_recordings, write_recording
from tracemesh.formats.scans import read_scan
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.sensing.orientation import ReferenceField
from tracemesh.geometry.simulated.moving_arrays import ARRAYS, MovingArray
from tracemesh.pipeline import reconstruct_measured, reconstruct_reading
from tracemesh.wire.arrays import ArrayCurve, ArrayReading, SensorArray
from tracemesh.wire.device import Device, Hello
from tracemesh.wire.resources import ReconstructionParameters
from tracemesh_bridge.sources.virtual_array import declare, measure

FINITE = st.floats(-1e6, 1e6)
VECTORS = st.tuples(FINITE, FINITE, FINITE)


@st.composite
def arrays(draw: st.DrawFn) -> SensorArray:
    """A spine, and curves that each share a sensor with what is there already."""
    count = draw(st.integers(3, 8))
    curves = [_curve(draw, list(range(count)))]
    for _ in range(draw(st.integers(0, 4))):
        fresh = draw(st.integers(1, 4))
        curves.append(_curve(draw, [draw(st.integers(0, count - 1)), *range(count, count + fresh)]))
        count += fresh
    return SensorArray(curves=curves)


def _curve(draw: st.DrawFn, sensors: list[int]) -> ArrayCurve:
    closed = len(sensors) > 2 and draw(st.booleans())
    gaps = len(sensors) - (not closed)
    spacing = draw(st.lists(st.floats(1e-3, 1.0), min_size=gaps, max_size=gaps))
    return ArrayCurve(sensors=sensors, spacing=spacing, boundary=draw(st.booleans()), closed=closed)


@given(arrays(), st.data())
@settings(max_examples=50, deadline=None)
def test_reading_undoes_writing(array: SensorArray, data: st.DataObject) -> None:
    count = array.sensor_count
    columns = st.lists(VECTORS, min_size=count, max_size=count)
    readings = [
        ArrayReading(seq=i, time=data.draw(FINITE), acceleration=data.draw(columns), magnetic=data.draw(columns))
        for i in range(data.draw(st.integers(0, 3)))
    ]
    recording = Recording(Hello(recording="r", device=Device(id="d", kind="array", array=array)), readings)
    assert read_recording(write_recording(recording).split("\n")) == recording


@given(arrays())
@settings(max_examples=50, deadline=None)
def test_every_declared_array_is_a_network(array: SensorArray) -> None:
    """Whatever is declared can be solved; all of its curves hang together, and as long as they are said to be."""
    device = Device(id="d", kind="array", array=array)
    rotations = np.tile(np.eye(3), (array.sensor_count, 1, 1))
    result = reconstruct_reading(sensor_array(device), rotations, ReconstructionParameters(surface=False, step="50%"))
    report = result.report["network"]
    assert isinstance(report, dict)
    assert report["sizes"]["length_m"] == pytest.approx(sum(sum(c.spacing) for c in array.curves))
    assert {s.curve for s in result.network.segments} == set(range(len(array.curves)))


@pytest.mark.parametrize(
    ("curves", "why"),
    [
        ([], "at least 1 item"),
        ([{"sensors": [0], "spacing": []}], "at least 2 items"),
        ([{"sensors": [0, 1], "spacing": [0.1, 0.1]}], "wanted 1 spacings between 2 sensors, got 2"),
        ([{"sensors": [0, 1, 0], "spacing": [0.1, 0.1]}], "wanted every sensor once on a curve"),
        ([{"sensors": [0, 1], "spacing": [0.1, 0.1], "closed": True}], "wanted three sensors or more"),
        ([{"sensors": [0, 2], "spacing": [0.1]}], "wanted every sensor from 0 to 2 on a curve, got none 1"),
        ([{"sensors": [0, 1], "spacing": [0.0]}], "greater than 0"),
        ([{"sensors": [0, 1], "spacing": [0.1], "mounting": []}], "wanted one mounting, or 2"),
        ([{"sensors": [0, 1], "spacing": [0.1]}, {"sensors": [2, 3], "spacing": [0.1]}], "curves that hang together"),
    ],
)
def test_an_array_that_cannot_be_is_refused(curves: list[object], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        SensorArray.model_validate({"curves": curves})


@pytest.mark.parametrize(
    ("columns", "why"),
    [
        ({}, "columns of one length"),
        ({"acceleration": [(0, 0, 1)]}, "got only"),
        ({"acceleration": [(0, 0, 1)], "magnetic": [(0, 1, 0)] * 2}, "columns of one length"),
        ({"quaternion": []}, "columns of one length"),
        ({"quaternion": [(1, 0, 0, float("nan"))]}, "finite"),
    ],
)
def test_a_reading_without_orientations_is_refused(columns: dict[str, object], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        ArrayReading.model_validate({"seq": 0, "time": 0.0, **columns})


def recorded(moving: MovingArray, times: list[float], noise: float = 0.0) -> Recording:
    """What an array's bridge sends."""
    generator = np.random.default_rng(0)
    device = Device(id="a", kind="array", array=declare(moving))
    readings = [measure(moving, t, noise, generator).model_copy(update={"seq": i}) for i, t in enumerate(times)]
    return Recording(Hello(recording="r", device=device), readings)


@pytest.mark.parametrize("name", ARRAYS)
def test_a_reading_gives_the_shape_that_it_was_made_of(name: str) -> None:
    moving = ARRAYS[name]()
    recording = recorded(moving, [0.0, 1.1, 2.2])
    result = reconstruct_measured(recording, ReconstructionParameters(reading=1))
    truth = moving.positions(1.1)
    nodes = result.network.points[result.network.nodes]
    expected = (truth - truth.mean(axis=0))[moving.array.nodes]
    assert nodes == pytest.approx(expected, abs=5e-3 * np.ptp(truth, axis=0).max())
    assert (result.mesh is not None) == (name == "lattice")
    assert bool(result.warnings) == (name != "lattice")


def test_quaternions_and_vectors_say_the_same() -> None:
    moving = ARRAYS["comb"]()
    recording = recorded(moving, [0.4])
    device, vectors = recording.hello.device, reading_of(recording)
    rotations = sensor_rotations(vectors, device)
    assert rotations == pytest.approx(moving.rotations(0.4), abs=1e-5)
    turned = device.model_copy(update={"mounting": (0.5, 0.5, 0.5, 0.5)})
    both = [sensor_array(d).curves[0].mounting[0] for d in (device, turned)]
    assert both[1] == pytest.approx(np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]) @ both[0])


def test_the_field_of_another_place_turns_the_readings() -> None:
    recording = recorded(ARRAYS["ribbon"](), [0.4])
    here = read_scan(write_recording(recording))
    there = read_scan(write_recording(recording), field=ReferenceField.from_inclination(np.pi / 3))
    assert not isinstance(here, Scan)
    assert not isinstance(there, Scan)
    first, second = (sensor_rotations(reading_of(r), r.hello.device) for r in (here, there))
    turn = second @ np.swapaxes(first, 1, 2)
    assert turn == pytest.approx(np.tile([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]], (8, 1, 1)), abs=1e-9)


def test_what_cannot_be_is_said() -> None:
    recording = recorded(ARRAYS["ribbon"](), [0.0, 0.1])
    empty = Recording(recording.hello, [])
    plain, reading = Device(id="d", kind="phone"), reading_of(recording)
    with pytest.raises(InputError, match="recording r: it holds no reading"):
        reading_of(empty)
    with pytest.raises(InputError, match="wanted a reading from 0 to 1, got 2"):
        reconstruct_measured(recording, ReconstructionParameters(reading=2))
    with pytest.raises(InputError, match="reading 1: a reading from a device whose hello has no array"):
        sensor_rotations(reading, plain)
    short = ArrayReading(seq=3, time=0.0, quaternion=[(1.0, 0.0, 0.0, 0.0)])
    with pytest.raises(InputError, match="reading 3: wanted 8 sensors, as the hello's array has, got 1"):
        sensor_rotations(short, recording.hello.device)
    blind = ArrayReading(seq=4, time=0.0, quaternion=[(1.0, 0.0, 0.0, 0.0)] * 7 + [(0.0, 0.0, 0.0, 0.0)])
    with pytest.raises(ScanError, match="reading 4: quaternion 8 is zero"):
        sensor_rotations(blind, recording.hello.device)
    with pytest.raises(InputError, match="wanted curves, got readings of an array"):
        scan_from_recordings([recording])
    with pytest.raises(ScanError, match="no nodes to find"):
        reconstruct_measured(recording, ReconstructionParameters(infer_nodes=True))
    with pytest.raises(InputError, match="lengths can be given for scanned curves"):
        reconstruct_measured(recording, ReconstructionParameters(), lengths={(0, 0): 1.0})
    with pytest.raises(InputError, match="this is a scan of curves"):
        reconstruct_measured(Scan(()), ReconstructionParameters(reading=0))


def test_spacings_that_are_wrong_are_told() -> None:
    """A row of a lattice is said to be a third longer than it is: its curves cannot meet."""
    recording = recorded(ARRAYS["lattice"](), [0.3])
    array = recording.hello.device.array
    assert array is not None
    longer = array.curves[3].model_copy(update={"spacing": [0.0667] * 7})
    curves = [*array.curves[:3], longer, *array.curves[4:]]
    device = recording.hello.device.model_copy(update={"array": SensorArray(curves=curves)})
    wrong = Recording(recording.hello.model_copy(update={"device": device}), recording.messages)
    result = reconstruct_measured(wrong, ReconstructionParameters(surface=False))
    assert "are spacings and mountings what they are said to be?" in result.warnings[0]
