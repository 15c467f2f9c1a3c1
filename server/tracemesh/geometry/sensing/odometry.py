"""Distance along a curve, from a wheel's ticks or, where nothing measured it, from time."""

from itertools import pairwise

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.scan import Floats, Ints

COUNTER_RANGE = 2**16
NOMINAL_SPEED = 0.08
"""m/s along a curve whose length nobody measured: shapes are right, sizes up to one factor."""
STILL = 0.02
"""rad; a device that turned less than this since a node was marked has not left it."""
LONGEST_PAUSE = 0.4
"""Most of a segment's time that may be taken for the pause at one of its ends: a straight line turns nothing at all."""


def distance_from_ticks(ticks: Ints, circumference: float, ticks_per_turn: int) -> Floats:
    """Distance (n,) m from the first sample on.

    ticks: (n, 2) turns and parts of a turn as counted since the device was switched on; the turns' counter is taken to
    wrap around at 16 bits.
    """
    steps = np.diff(ticks[:, 0])
    steps = (steps + COUNTER_RANGE // 2) % COUNTER_RANGE - COUNTER_RANGE // 2
    turns = np.concatenate([[0], np.cumsum(steps)])
    travelled = turns + (ticks[:, 1] - ticks[0, 1]) / ticks_per_turn
    result: Floats = travelled * circumference
    return result


def distance_from_time(time: Floats, frames: Floats, node_samples: Ints) -> Floats:
    """Distance (n,) m at a constant speed of NOMINAL_SPEED along each segment, less the pauses at its nodes.

    time: (n,) s, never decreasing. frames: (n, 3, 3). node_samples: (m,). Raises ScanError where time runs backwards.
    """
    backwards = np.flatnonzero(np.diff(time) < 0)
    if len(backwards):
        raise ScanError(f"the device's clock runs backwards after sample {backwards[0] + 1}")
    moving = np.concatenate([[0.0], np.diff(time)])
    ends = np.unique(np.concatenate([[0], node_samples, [len(time) - 1]]))
    for first, last in pairwise(ends.tolist()):
        limit = LONGEST_PAUSE * (time[last] - time[first])
        after = _still(frames[first : last + 1]) & (time[first : last + 1] - time[first] <= limit)
        before = _still(frames[first : last + 1][::-1])[::-1] & (time[last] - time[first : last + 1] <= limit)
        moving[first + 1 : last + 1][after[1:] | before[:-1]] = 0.0
    return NOMINAL_SPEED * np.cumsum(moving)


def _still(frames: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which frames (n, 3, 3), from the first on without a break, are turned by less than STILL against the first."""
    cosine = (np.einsum("ij,nij->n", frames[0], frames) - 1) / 2
    near = cosine > np.cos(STILL)
    result: np.ndarray[tuple[int], np.dtype[np.bool_]] = np.logical_and.accumulate(near)
    return result
