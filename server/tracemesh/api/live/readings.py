"""Readings of fixed arrays as browsers get them."""

from tracemesh.api.live.drawing import flat
from tracemesh.jobs.attached import SolvedNetwork
from tracemesh.jobs.readings import SolvedReading
from tracemesh.storage.readings import StoredReading
from tracemesh.wire.device import Device
from tracemesh.wire.live import LiveCurve, LiveReading
from tracemesh.wire.resources import NodePosition


def live_reading(stored: StoredReading, solved: SolvedReading) -> LiveReading:
    """What is drawn of a reading whose network was solved."""
    return LiveReading(
        recording=stored.recording,
        number=stored.number,
        time=stored.reading.time,
        curves=array_curves(stored.device, solved),
        nodes=node_positions(solved),
    )


def array_curves(device: Device, solved: SolvedReading) -> list[LiveCurve]:
    """The curves of an array, all of them complete."""
    assert device.array is not None
    return [
        LiveCurve(
            index=index,
            boundary=curve.boundary,
            closed=curve.closed,
            ended=True,
            positions=flat(solved.curves[index]),
        )
        for index, curve in enumerate(device.array.curves)
    ]


def node_positions(solved: SolvedNetwork | SolvedReading) -> list[NodePosition]:
    """Solved nodes by their numbers."""
    rows = ((number, position.tolist()) for number, position in sorted(solved.nodes.items()))
    return [NodePosition(node=number, position=(x, y, z)) for number, (x, y, z) in rows]
