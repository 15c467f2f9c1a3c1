"""What a device measured along curves, as the kernel takes it: the input of the whole reconstruction."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _no_marks() -> Ints:
    return np.empty(0, np.int64)


@dataclass(frozen=True)
class CurveScan:
    """Samples along one curve in the order in which they were measured.

    distance: (n,) m, travelled along the curve; need not start at 0 nor be strictly increasing.
    tangent: (n, 3) unit vectors, world (ENU); direction of travel; need not be orthogonal to `normal`.
    normal: (n, 3) unit vectors, world; outward surface normal.
    node_samples: (m,) indices into the samples where a node was marked, increasing.
    node_ids: (m,) number of the node marked there; a closed curve repeats its first node last.
    boundary: the curve bounds the surface (one face beside it) instead of running inside it (two).
    closed: the curve ends where it began.
    acceleration, magnetic: (n, 3) or None, the raw vectors in the device's frame, any unit; used to judge quality.
    time: (n,) s or None, device clock.
    timed: the distance was made from durations; between two nodes it is right up to a factor that is not known.
    lengths: (s,) m or None, of its segments, in order, where somebody measured them; NaN elsewhere. Segments lie
    between its nodes; a curve without nodes is one, and the only node of an open curve parts it in two.
    calibration: what people call the calibration with which it was made of a device's readings; empty: none.
    """

    distance: Floats
    tangent: Floats
    normal: Floats
    node_samples: Ints = field(default_factory=_no_marks)
    node_ids: Ints = field(default_factory=_no_marks)
    boundary: bool = False
    closed: bool = False
    acceleration: Floats | None = None
    magnetic: Floats | None = None
    time: Floats | None = None
    timed: bool = False
    lengths: Floats | None = None
    calibration: str = ""


@dataclass(frozen=True)
class Scan:
    """All curves scanned on one object; nodes with the same number are the same point of the object."""

    curves: tuple[CurveScan, ...]


def curve_name(index: int) -> str:
    """What messages call the curve at an index of the scan: people count from one."""
    return f"curve {index + 1}"
