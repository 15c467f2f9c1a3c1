"""Recordings: what a device sent, as newline-delimited JSON of wire messages; and the scan that they amount to."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from pydantic import ValidationError

from tracemesh.errors import InputError, ScanError
from tracemesh.formats.calibrations import calibrate
from tracemesh.geometry.curves.closed_curves import begun_at_nodes
from tracemesh.geometry.rotations import darboux_frames, normalized, quaternion_to_matrix
from tracemesh.geometry.scan import CurveScan, Floats, Ints, Scan
from tracemesh.geometry.sensing.fusion import frames_from_imu
from tracemesh.geometry.sensing.odometry import distance_from_ticks, distance_from_time
from tracemesh.geometry.sensing.orientation import ReferenceField, frames_from_quaternions, frames_from_vectors
from tracemesh.geometry.sensing.wheel_offset import at_wheel
from tracemesh.geometry.simulated.simulation import (
    COUNTS,
    FULL_SCALE,
    REFERENCE_ACCELERATION,
    REFERENCE_MAGNETIC,
    TICKS_PER_TURN,
    WHEEL_CIRCUMFERENCE,
    SimulatedCurve,
)
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import (
    MAX_SAMPLES,
    CurveEnd,
    CurveStart,
    Device,
    Hello,
    NodeMark,
    Recorded,
    Reference,
    Samples,
    Wheel,
    from_device,
)


@dataclass(frozen=True)
class Recording:
    """hello, and the numbered messages after it in their order."""

    hello: Hello
    messages: Sequence[Recorded]


def read_recording(lines: Iterable[str], source: str = "") -> Recording:
    """Recording in newline-delimited JSON, `hello` first; raises InputError with `source` and line."""
    hello: Hello | None = None
    messages: list[Recorded] = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        where = f"{source}: line {number}" if source else f"line {number}"
        message = _message(line, where)
        if hello is None:
            if not isinstance(message, Hello):
                raise InputError(f"{where}: wanted hello first, got {message.type}")
            hello = message
        elif isinstance(message, Hello):
            raise InputError(f"{where}: wanted one hello, got a second one")
        elif message.seq != len(messages):
            raise InputError(f"{where}: wanted the message with seq {len(messages)}, got {message.seq}")
        else:
            messages.append(message)
    if hello is None:
        raise InputError(f"{source or 'recording'}: wanted hello first, got nothing")
    return Recording(hello, messages)


def write_recording(recording: Recording) -> str:
    """Text of which `read_recording` makes the same recording."""
    messages = [recording.hello, *recording.messages]
    return "".join(m.model_dump_json(exclude_none=True) + "\n" for m in messages)


def scan_from_recordings(recordings: Sequence[Recording]) -> Scan:
    """All curves of all recordings, in order, less those discarded and those without samples; closed ones go from
    their first node around to it. Raises what `scan_as_sent` raises.
    """
    return begun_at_nodes(scan_as_sent(recordings))


def scan_as_sent(recordings: Sequence[Recording]) -> Scan:
    """The same, with every curve's samples in the order in which they were sent.

    Raises InputError where messages contradict each other, ScanError where a curve's numbers make no sense; both name
    the curve, counted from 1 over everything.
    """
    curves: list[CurveScan] = []
    for recording in recordings:
        for raw in _raw_curves(recording, len(curves)):
            curves.append(_named(f"curve {len(curves) + 1}", raw, recording.hello.device))
    return Scan(tuple(curves))


def recording_from_scan(scan: Scan, recording: str, session: str | None = None) -> Recording:
    """A scan as if a device had sent it: distances, tangents and normals, and vectors and times if it has them."""
    device = Device(id=recording, kind="file")
    curves = (_columns(c) for c in scan.curves)
    marks = ((c.node_samples, c.node_ids) for c in scan.curves)
    flags = ((c.boundary, c.closed) for c in scan.curves)
    return _recording(
        Hello(recording=recording, session=session, device=device), zip(curves, marks, flags, strict=True)
    )


def recording_from_simulation(
    curves: Sequence[SimulatedCurve], recording: str, session: str | None = None
) -> Recording:
    """What a Morphorider's bridge sends for simulated curves: ticks and vectors."""
    wheel = Wheel(circumference=WHEEL_CIRCUMFERENCE, ticks_per_turn=TICKS_PER_TURN)
    reference = Reference(acceleration=REFERENCE_ACCELERATION, magnetic=REFERENCE_MAGNETIC)
    device = Device(id="simulated", kind="morphorider", wheel=wheel, reference=reference)
    columns = (
        {
            "time": c.time.tolist(),
            "ticks": c.readings.ticks.tolist(),
            "acceleration": (c.readings.acceleration * (FULL_SCALE / COUNTS)).tolist(),
            "magnetic": (c.readings.magnetic * (FULL_SCALE / COUNTS)).tolist(),
        }
        for c in curves
    )
    marks = ((c.node_samples, c.node_ids) for c in curves)
    flags = ((c.boundary, c.closed) for c in curves)
    hello = Hello(recording=recording, session=session, device=device)
    return _recording(hello, zip(columns, marks, flags, strict=True))


Columns = dict[str, list[object]]


def _recording(hello: Hello, curves: Iterable[tuple[Columns, tuple[Ints, Ints], tuple[bool, bool]]]) -> Recording:
    messages: list[Recorded] = []
    for number, (columns, (samples, ids), (boundary, closed)) in enumerate(curves):
        messages.append(CurveStart(seq=len(messages), curve=number, boundary=boundary))
        for first in range(0, len(next(iter(columns.values()))), MAX_SAMPLES):
            block = {name: column[first : first + MAX_SAMPLES] for name, column in columns.items()}
            head = {"seq": len(messages), "curve": number, "first_sample": first}
            messages.append(Samples.model_validate(head | block))
        for sample, node in zip(samples.tolist(), ids.tolist(), strict=True):
            messages.append(NodeMark(seq=len(messages), curve=number, sample=sample, node=node))
        messages.append(CurveEnd(seq=len(messages), curve=number, closed=closed))
    return Recording(hello, messages)


def _columns(curve: CurveScan) -> Columns:
    columns = {name: getattr(curve, name) for name in ("time", "distance", "acceleration", "magnetic")}
    columns |= {"tangent": curve.tangent, "normal": curve.normal}
    return {name: column.tolist() for name, column in columns.items() if column is not None}


def _message(line: str, where: str) -> Hello | Recorded:
    try:
        return from_device.validate_json(line)
    except ValidationError as error:
        first = error.errors()[0]
        if first["type"] == "union_tag_not_found":
            raise InputError(f'{where}: wanted a message of a recording, such as {{"type": "hello", ...}}') from None
        place = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{where}: {place + ': ' if place else ''}{first['msg']}") from None


@dataclass
class _RawCurve:
    """What was sent about one curve, put together."""

    boundary: bool
    blocks: list[Samples] = field(default_factory=list)
    marks: list[tuple[int, int]] = field(default_factory=list)
    count: int = 0
    ended: bool = False
    closed: bool = False
    discarded: bool = False

    def add(self, message: Samples | NodeMark | CurveEnd, where: str) -> None:
        """Take in one message; raises InputError where it contradicts the ones before."""
        if isinstance(message, Samples):
            if message.first_sample != self.count:
                raise InputError(f"{where}: wanted sample {self.count} next, got {message.first_sample}")
            self.blocks.append(message)
            self.count += message.count
        elif isinstance(message, CurveEnd):
            self.ended, self.closed, self.discarded = True, message.closed, message.discard
        else:
            self._mark(message, where)

    def _mark(self, message: NodeMark, where: str) -> None:
        mark = (message.sample, message.node)
        if message.undo and mark not in self.marks:
            raise InputError(f"{where}: node {message.node} was not marked at sample {message.sample}: nothing to undo")
        if message.undo:
            self.marks.remove(mark)
        elif mark not in self.marks:
            self.marks.append(mark)


def _raw_curves(recording: Recording, before: int) -> Iterator[_RawCurve]:
    """Curves worth reconstructing, in order of their beginning."""
    curves: dict[int, _RawCurve] = {}
    for message in recording.messages:
        if isinstance(message, ArrayReading):
            raise InputError(f"recording {recording.hello.recording}: wanted curves, got readings of an array")
        where = f"recording {recording.hello.recording}: curve {before + message.curve + 1}"
        if isinstance(message, CurveStart):
            if message.curve in curves:
                raise InputError(f"{where} begins twice")
            curves[message.curve] = _RawCurve(message.boundary)
        elif message.curve not in curves:
            raise InputError(f"{where}: got {message.type} before curve.start")
        elif curves[message.curve].ended and not isinstance(message, NodeMark):
            raise InputError(f"{where}: got {message.type} after curve.end")
        else:
            curves[message.curve].add(message, where)
    return (c for c in curves.values() if c.count and not c.discarded)


def _named(name: str, raw: _RawCurve, device: Device) -> CurveScan:
    try:
        return _curve(raw, device)
    except (ScanError, InputError) as error:
        raise type(error)(f"{name}: {error}") from None


def _curve(raw: _RawCurve, device: Device) -> CurveScan:
    right = calibrate(_joined(raw.blocks), device)
    columns, device = right.columns, right.device
    samples, ids = _marks(raw)
    tangent, normal = _orientation(columns, device)
    distance = _distance(columns, device, tangent, normal, samples)
    scan = CurveScan(
        distance, tangent, normal, samples, ids, raw.boundary, raw.closed,
        columns.get("acceleration"), columns.get("magnetic"), columns.get("time"),
        timed=columns.keys().isdisjoint({"distance", "ticks"}),
        calibration=right.label,
    )  # fmt: skip
    moved = device.wheel is not None and any(device.wheel.offset) and not scan.timed
    return _at_wheel(scan, device) if moved else scan


def _at_wheel(scan: CurveScan, device: Device) -> CurveScan:
    """The curve as if the sensors were where the wheel touches."""
    assert device.wheel is not None
    round_trip = len(scan.node_ids) > 1 and scan.node_ids[0] == scan.node_ids[-1]
    ends = (scan.node_samples[0], scan.node_samples[-1]) if round_trip else (0, len(scan.distance) - 1)
    lap = (int(ends[0]), int(ends[1])) if scan.closed else None
    moved = at_wheel(scan.distance, darboux_frames(scan.tangent, scan.normal), np.array(device.wheel.offset), lap)
    vectors = (None if v is None else v[moved.nearest] for v in (scan.acceleration, scan.magnetic))
    acceleration, magnetic = vectors
    return replace(
        scan, distance=moved.distance, tangent=moved.frames[:, :, 0].copy(), normal=moved.frames[:, :, 1].copy(),
        acceleration=acceleration, magnetic=magnetic,
    )  # fmt: skip


def with_marks(curve: CurveScan, marks: Sequence[tuple[int, int]]) -> CurveScan:
    """A curve as sent with these marks (sample, node) instead of its own; what was timed is timed anew between them."""
    samples, ids = np.array(sorted(marks), np.int64).reshape(-1, 2).T
    distance = curve.distance
    if curve.timed and curve.time is not None:
        frames = np.stack([curve.tangent, curve.normal, np.cross(curve.tangent, curve.normal)], axis=2)
        distance = distance_from_time(curve.time, frames, samples, curve.acceleration)
    lengths = curve.lengths if len(samples) == len(curve.node_samples) else None
    return replace(curve, distance=distance, node_samples=samples, node_ids=ids, lengths=lengths)


def _joined(blocks: Sequence[Samples]) -> dict[str, Floats]:
    """Columns over all blocks: those that every block has."""
    parts = [block.columns() for block in blocks]
    names = set.intersection(*(set(p) for p in parts)) - {"received"}
    return {n: np.array([row for p in parts for row in p[n]], np.float64) for n in names}


def _marks(raw: _RawCurve) -> tuple[Ints, Ints]:
    marks = sorted(raw.marks)
    for sample, node in marks:
        if sample >= raw.count:
            raise InputError(
                f"node {node} is marked at sample {sample}, wanted less than {raw.count}, the number of samples"
            )
    for (sample, one), (other, two) in pairwise(marks):
        if sample == other:
            raise InputError(f"sample {sample} is marked as node {one} and as node {two}")
    table = np.array(marks, np.int64).reshape(-1, 2)
    return table[:, 0].copy(), table[:, 1].copy()


def _orientation(columns: dict[str, Floats], device: Device) -> tuple[Floats, Floats]:
    """Tangents and normals: as sent, or from quaternions, or from a gyroscope and vectors, or from vectors alone."""
    if {"tangent", "normal"} <= columns.keys():
        return columns["tangent"], columns["normal"]
    mounting = quaternion_to_matrix(normalized(np.array(device.mounting)))
    if "quaternion" in columns:
        frames = frames_from_quaternions(columns["quaternion"], mounting)
    elif {"time", "rotation_rate", "acceleration", "magnetic"} <= columns.keys():
        vectors = columns["rotation_rate"], columns["acceleration"], columns["magnetic"]
        frames = frames_from_imu(columns["time"], *vectors, mounting)
    elif {"acceleration", "magnetic"} <= columns.keys():
        reference = ReferenceField(device.reference.acceleration, device.reference.magnetic)
        frames = frames_from_vectors(columns["acceleration"], columns["magnetic"], reference, mounting)
    else:
        raise InputError("wanted one kind of orientation in all its blocks, got different ones")
    return frames[:, :, 0].copy(), frames[:, :, 1].copy()


def _distance(columns: dict[str, Floats], device: Device, tangent: Floats, normal: Floats, marks: Ints) -> Floats:
    if "distance" in columns:
        return columns["distance"]
    if "ticks" in columns:
        if device.wheel is None:
            raise InputError("it has wheel ticks, but its device's hello names no wheel")
        return distance_from_ticks(
            columns["ticks"].astype(np.int64), device.wheel.circumference, device.wheel.ticks_per_turn
        )
    if "time" in columns:
        frames = np.stack([tangent, normal, np.cross(tangent, normal)], axis=2)
        return distance_from_time(columns["time"], frames, marks, columns.get("acceleration"))
    raise InputError("wanted ticks, distance or time in all its blocks, got none of them")
