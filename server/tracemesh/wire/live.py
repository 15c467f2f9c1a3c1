"""What a browser receives on /api/v1/sessions/{session}/live: the current state first, then what changes.

Latest wins: this path may drop, never delay, and never shares a queue with the recorder. Positions are world (ENU, z
up) in metres; flat lists [x0, y0, z0, x1, ...] because a browser puts them into a buffer as they are.
"""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from tracemesh.wire.base import Count, Identifier, Message
from tracemesh.wire.resources import NodePosition, Reconstruction


class LiveCurve(Message):
    """One curve as drawn: dead reckoning while it is scanned, consistent once the network was solved."""

    index: Count
    boundary: bool
    closed: bool = False
    ended: bool = False
    positions: list[float] = Field(default=[])
    samples: list[Count] = Field(default=[], description="for each point, the sample of the curve that it is at")


class LiveDevice(Message):
    """Health of a device that records into the session."""

    type: Literal["live.device"] = "live.device"
    recording: Identifier
    kind: str
    name: str
    state: Literal["live", "stale", "lost"]
    rate: float = Field(ge=0, description="samples, or readings of an array, per second, over the last second")
    age: float = Field(ge=0, description="s since the last sample arrived")
    jitter: float | None = Field(
        default=None, ge=0, description="s, standard deviation of the time between its last samples"
    )
    acceleration_norm: float | None = Field(default=None, description="mean of |acceleration|, the device's own unit")
    magnetic_norm: float | None = Field(default=None, description="mean of |magnetic|, the device's own unit")
    dip: float | None = Field(default=None, description="rad, angle of the field below the horizontal")


class LiveReading(Message):
    """The network of one reading of a fixed array; a newer one of the same recording replaces it.

    Its curves are numbered as in the array's declaration, its nodes as their sensors.
    """

    type: Literal["live.reading"] = "live.reading"
    recording: Identifier
    number: Count = Field(description="of the reading within the session")
    time: float = Field(description="s, the device's own clock")
    curves: list[LiveCurve]
    nodes: list[NodePosition]


class Snapshot(Message):
    """Everything a late joiner needs."""

    type: Literal["live.snapshot"] = "live.snapshot"
    session: Identifier
    curves: list[LiveCurve]
    nodes: list[NodePosition]
    devices: list[LiveDevice] = Field(default=[])
    readings: list[LiveReading] = Field(default=[], description="the newest one of every array that has one")
    reconstruction: Reconstruction | None = None
    watchers: Count = Field(default=0, description="as in live.watchers")


class LiveWatchers(Message):
    """Somebody joined or left: how many sockets watch the session on this server, the receiver's own included.

    Those that watch the same session through another server are not counted.
    """

    type: Literal["live.watchers"] = "live.watchers"
    count: Count


class LiveCurveStart(Message):
    """A curve begins."""

    type: Literal["live.curve.start"] = "live.curve.start"
    index: Count
    boundary: bool


class LivePoints(Message):
    """New points at the end of a curve."""

    type: Literal["live.points"] = "live.points"
    index: Count
    first: Count = Field(description="number of the first of these points within the curve as drawn")
    positions: list[float]
    samples: list[Count] = Field(default=[], description="for each point, the sample of the curve that it is at")


class LiveNode(Message):
    """A node was marked."""

    type: Literal["live.node"] = "live.node"
    index: Count = Field(description="curve")
    node: NodePosition


class LiveCurveEnd(Message):
    """A curve ends."""

    type: Literal["live.curve.end"] = "live.curve.end"
    index: Count
    closed: bool


class LiveNetwork(Message):
    """All curves and nodes after the network was solved again; replaces everything drawn before."""

    type: Literal["live.network"] = "live.network"
    curves: list[LiveCurve]
    nodes: list[NodePosition]


class Preview(Message):
    """Answer to POST /sessions/{session}/preview: the network that these parameters give, without its surface."""

    curves: list[LiveCurve]
    nodes: list[NodePosition]
    report: dict[str, object] = Field(description="what was chosen and found, as in report.json")


class LiveReconstruction(Message):
    """A reconstruction was created, made progress, or ended."""

    type: Literal["live.reconstruction"] = "live.reconstruction"
    reconstruction: Reconstruction


Change = (
    LiveCurveStart
    | LivePoints
    | LiveNode
    | LiveCurveEnd
    | LiveNetwork
    | LiveReading
    | LiveDevice
    | LiveWatchers
    | LiveReconstruction
)
ToBrowser = Annotated[Snapshot | Change, Field(discriminator="type")]
to_browser: TypeAdapter[Snapshot | Change] = TypeAdapter(ToBrowser)
