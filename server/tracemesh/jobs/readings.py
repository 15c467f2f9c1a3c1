"""The network of one reading of a fixed array, solved where there is time for it.

The kernel is imported where it runs: the server itself stays small and starts at once.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Device
from tracemesh.wire.resources import ReconstructionParameters

if TYPE_CHECKING:
    from tracemesh.geometry.curves.array_network import ArraySolver
    from tracemesh.geometry.network import CurveNetwork
    from tracemesh.geometry.scan import Floats, Ints

DRAWN_PER_GAP = 6
"""Points drawn from one sensor to the next."""
MOST_DRAWN = 3000
"""Points drawn of an array, however many sensors it has."""


@dataclass(frozen=True)
class SolvedReading:
    """Points (n, 3) m, world, of every curve of the array, and nodes (3,) m by the number of their sensor."""

    curves: list["Floats"]
    nodes: dict[int, "Floats"]
    report: dict[str, object]


def draw_reading(device: str, reading: ArrayReading) -> SolvedReading:
    """The network of a reading of the device with this JSON, as a live view draws it: at the array's own rate.

    Raises InputError and ScanError.
    """
    from tracemesh.formats.readings import sensor_rotations

    known, solver, nodes = _drawer(device)
    return _solved(solver.solve(sensor_rotations(reading, known)).network, nodes, {})


def solve_reading(device: Device, reading: ArrayReading, parameters: ReconstructionParameters) -> SolvedReading:
    """The network of a reading with these parameters; raises InputError and ScanError."""
    from tracemesh.formats.readings import sensor_array, sensor_rotations
    from tracemesh.pipeline import reconstruct_reading

    array = sensor_array(device)
    wanted = parameters.model_copy(update={"surface": False})
    result = reconstruct_reading(array, sensor_rotations(reading, device), wanted)
    network = result.report["network"]
    assert isinstance(network, dict)
    return _solved(result.network, array.nodes, network)


@lru_cache(maxsize=8)
def _drawer(device: str) -> tuple[Device, "ArraySolver", "Ints"]:
    """What all readings of one array share."""
    from tracemesh.formats.readings import sensor_array
    from tracemesh.geometry.curves.array_network import ArraySolver

    known = Device.model_validate_json(device)
    array = sensor_array(known)
    spacing = np.concatenate([curve.spacing for curve in array.curves])
    step = max(float(spacing.max()) / DRAWN_PER_GAP, float(spacing.sum()) / MOST_DRAWN)
    return known, ArraySolver(array, step), array.nodes


def _solved(network: "CurveNetwork", sensors: "Ints", report: dict[str, object]) -> SolvedReading:
    count = 1 + max(segment.curve for segment in network.segments)
    nodes = {int(s): network.points[p] for s, p in zip(sensors, network.nodes, strict=True)}
    return SolvedReading([_along(network, curve) for curve in range(count)], nodes, report)


def _along(network: "CurveNetwork", curve: int) -> "Floats":
    """Points (n, 3) of one curve from its beginning to its end."""
    segments = [segment.points for segment in network.segments if segment.curve == curve]
    positions: Floats = network.points[np.concatenate([segments[0], *(points[1:] for points in segments[1:])])]
    return positions
