"""Bodies of the REST API under /api/v1; every length in metres, every time in seconds."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from tracemesh.wire.base import Coordinates, Count, Identifier, Message, Name
from tracemesh.wire.calibration import Version
from tracemesh.wire.device import Device

PERCENT_OR_METRES = r"^\d+(\.\d+)?(e-?\d+)?%?$"


class SessionCreate(Message):
    """POST /sessions."""

    id: Identifier | None = Field(default=None, description="chosen by the caller; none: the server chooses")
    name: Name = ""


class SessionUpdate(Message):
    """PATCH /sessions/{session}; absent fields stay."""

    name: Name | None = None


class Session(Message):
    """One object being scanned."""

    id: Identifier
    name: str
    created: datetime
    curves: Count
    samples: Count
    nodes: Count = Field(description="distinct node numbers marked")
    readings: Count = Field(default=0, description="of fixed arrays")
    latest_reconstruction: Identifier | None = Field(default=None, description="newest one that is done")


class OutlineCurve(Message):
    """One line of an outline."""

    boundary: bool
    positions: list[float] = Field(description="m, world: [x0, y0, z0, x1, ...]")


class Outline(Message):
    """GET /sessions/{session}/outline: what it looks like, in few points; for a list of many sessions."""

    curves: list[OutlineCurve]


class ComparisonProgress(Message):
    """A line of the answer to POST /reconstructions/{reconstruction}/comparison while it is worked on."""

    type: Literal["progress"] = "progress"
    stage: str
    fraction: float = Field(ge=0, le=1)


class Comparison(Message):
    """Its last line: how far the surface is from a true one, in % of the truth's diagonal unless it says otherwise."""

    type: Literal["comparison"] = "comparison"
    mean: float
    rms: float
    max: float
    min: float
    normal_deg: float | None = Field(description="mean angle to the true normals, degrees")
    diagonal: float = Field(description="m, of the truth's bounding box")
    rotation: list[Coordinates] = Field(description="rows; a vertex x was placed at scale * rotation x + translation")
    translation: Coordinates = Field(description="m")
    scale: float
    signed_distance: list[float] = Field(description="m, of every vertex of mesh.glb; negative inside the truth")


class ComparisonFailure(Message):
    """Its last line when it could not be done."""

    type: Literal["failure"] = "failure"
    detail: str


class Mark(Message):
    """A node marked on a curve."""

    sample: Count
    node: Count


class MeasuredLength(Message):
    """A length of a curve between two of its samples that somebody measured."""

    first: Count = Field(description="sample that it is measured from")
    last: Count = Field(description="sample that it is measured to; over the end of a closed curve where it is before")
    length: float = Field(gt=0, description="m")


class Curve(Message):
    """One scanned curve of a session."""

    index: Count = Field(description="number within the session, in order of scanning")
    recording: Identifier
    boundary: bool
    closed: bool
    ended: bool
    samples: Count
    length: float = Field(ge=0, description="m, as the odometer saw it")
    marks: list[Mark]
    lengths: list[MeasuredLength] = Field(
        default=[], description="of segments; used while both ends are marked, or are those of a curve without marks"
    )


class CurveUpdate(Message):
    """PATCH /sessions/{session}/curves/{index}; absent fields stay."""

    boundary: bool | None = None
    closed: bool | None = None
    removed: bool | None = Field(default=None, description="left out of everything; its samples stay stored")
    marks: list[Mark] | None = Field(default=None, max_length=10_000, description="replace all marks of the curve")
    lengths: list[MeasuredLength] | None = Field(
        default=None, max_length=10_000, description="replace all measured lengths of the curve"
    )


class NodePlace(Message):
    """Where a node is on one of its curves."""

    curve: Count = Field(description="index within the session")
    sample: Count


class NodeProposal(Message):
    """A node that was found, or one marked already; accepted by marking its places with PATCH on their curves."""

    places: list[NodePlace]
    confidence: float = Field(ge=0, le=1)
    node: Count | None = Field(default=None, description="its number, if it is marked already")


class NodeProposals(Message):
    """GET /sessions/{session}/node-proposals."""

    proposals: list[NodeProposal]
    unplaced: list[Count] = Field(description="curves of which nothing is known: no place was found for them")


class Readings(Message):
    """GET /sessions/{session}/readings: when the readings of fixed arrays were taken."""

    count: Count = Field(description="of all readings of the session; they are numbered 0, 1, 2, ...")
    first: Count = Field(description="number of the reading to which the first of `times` belongs")
    times: list[float] = Field(description="s, the device's own clock")


class NetworkNode(Message):
    """A node of the latest network of a session."""

    index: Count
    position: Coordinates = Field(description="m, world")
    normal: Coordinates = Field(description="unit, outward")
    segments: list[Count] = Field(description="indices of those that begin or end here")


class NetworkSegment(Message):
    """A piece of a curve between two nodes of the latest network of a session."""

    index: Count
    curve: Count = Field(description="number of its curve among those that were reconstructed")
    boundary: bool
    nodes: list[Count] = Field(description="indices of the nodes at its ends; a closed curve that meets none has none")
    points: Count
    length: float = Field(ge=0, description="m")


class RecordingSummary(Message):
    """A recording of a session: what one device sent, or one uploaded file."""

    id: Identifier
    session: Identifier
    device: Device
    messages: Count
    bytes: Count
    created: datetime
    calibration: Version | None = Field(default=None, description="of its device, applied when it is reconstructed")


class RecordingUpdate(Message):
    """PATCH /sessions/{session}/recordings/{recording}; absent fields stay."""

    calibration: Version | None = Field(default=None, description="version of its device's calibration; null: none")


class ReconstructionParameters(Message):
    """What a person may choose; everything left out is chosen automatically and reported."""

    step: str = Field(
        default="1.6%",
        pattern=PERCENT_OR_METRES,
        description="distance of the network's points: % of the estimated diagonal, or m",
    )
    mesh_size: str | None = Field(
        default=None,
        pattern=PERCENT_OR_METRES,
        description="distance of the surface's vertices: % of the estimated diagonal, or m; none: as its points",
    )
    prefilter: float | None = Field(
        default=None,
        gt=0,
        description="standard deviation of the Gaussian with which scanned frames are resampled, m; none: half a step",
    )
    stretch: float | None = Field(default=None, ge=0, description="smoothing length of the stretch term, m")
    bend: float | None = Field(default=None, ge=0, description="smoothing length of the bend term, m")
    weights: Literal["auto", "thesis"] = "auto"
    curve_bias: Literal["auto", "on", "off"] = "auto"
    robust: bool = Field(default=False, description="bear several percent of frames that are pure chance")
    infer_nodes: bool = Field(
        default=False, description="find the nodes that are not marked; those marked already are kept"
    )
    soft: bool = Field(default=False, description="let the surface leave a noisy network a little")
    surface: bool = Field(default=True, description="also span the surface, not only the network")
    reading: Count | None = Field(
        default=None, description="of a fixed array: number of the reading within the session; none: the last one"
    )


class CurveEdit(Message):
    """A change of one curve, to be made with PATCH."""

    curve: Count = Field(description="index within the session")
    change: CurveUpdate


class Fix(Message):
    """What would mend a problem."""

    label: str = Field(description="in words, for a button")
    changes: list[CurveEdit] = Field(default=[], description="none: look for nodes that nobody marked")


class NetworkProblem(Message):
    """What keeps a session's curves from being a network with a surface, or what a person should know of it."""

    message: str
    severity: Literal["error", "warning"]
    curves: list[Count] = Field(default=[], description="indices of the curves that it is about")
    samples: tuple[Count, Count] | None = Field(default=None, description="from where to where on the first of them")
    fix: Fix | None = None


class NetworkProblems(Message):
    """GET /sessions/{session}/problems."""

    problems: list[NetworkProblem]


class CurveMarks(Message):
    """Marks of one curve."""

    curve: Count = Field(description="index within the session")
    marks: list[Mark] = Field(max_length=10_000)


class PreviewWish(ReconstructionParameters):
    """POST /sessions/{session}/preview."""

    marks: list[CurveMarks] = Field(
        default=[], max_length=1000, description="tried out instead of the marks that these curves have"
    )


JobState = Literal["queued", "running", "done", "failed", "cancelled"]


class Batch(Message):
    """Many scans that were sent at once, each with a reconstruction of its own; and how many are in which state."""

    id: Identifier
    name: str
    created: datetime
    size: Count = Field(
        description="scans; those that no state counts are being taken in, or their session was deleted"
    )
    queued: Count
    running: Count
    done: Count
    failed: Count
    cancelled: Count
    fraction: float = Field(ge=0, le=1, description="of all its work")


class Reconstruction(Message):
    """A reconstruction of a session: a job, and its results once it is done."""

    id: Identifier
    session: Identifier
    batch: Identifier | None = Field(
        default=None, description="it was sent with others, and comes after what is waited for"
    )
    state: JobState
    stage: str = Field(default="", description="what is being done, in words")
    fraction: float = Field(default=0.0, ge=0, le=1)
    error: str | None = Field(default=None, description="why it failed, in words for people")
    parameters: ReconstructionParameters
    created: datetime
    finished: datetime | None = None
    artifacts: dict[str, str] = Field(default={}, description="file name -> URL: network.json, mesh.glb, report.json")


class Problem(Message):
    """RFC 9457 problem details: the one error envelope of the API."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str = ""
    instance: str = ""
    errors: list[dict[str, object]] = Field(default=[], description="per field: where, what was wanted, what came")


class NodePosition(Message):
    """Where a node is, as far as known."""

    node: Count
    position: Coordinates
