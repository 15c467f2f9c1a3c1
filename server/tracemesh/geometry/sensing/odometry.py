"""Distance along a curve, from a wheel's ticks or, where nothing measured it, from time."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tracemesh.errors import ScanError
from tracemesh.geometry.scan import Floats, Ints

Bools = NDArray[np.bool_]
COUNTER_RANGE = 2**16
NOMINAL_SPEED = 0.08
"""m/s along a curve whose length nobody measured: shapes are right, sizes up to one factor."""
STILL = 0.02
"""rad; a device that turned less than this since a node was marked has not left it."""
PAUSE_WINDOW = 0.25
"""s over which a device is felt to be shaken."""
SHAKEN, QUIET = 3.0, 1.7
"""Times the least shaking: what a hand that moves it does at least, and what one that does not does at most."""
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


def distance_from_time(time: Floats, frames: Floats, node_samples: Ints, acceleration: Floats | None = None) -> Floats:
    """Distance (n,) m at a constant speed of NOMINAL_SPEED along each segment, less the pauses.

    time: (n,) s, never decreasing. frames: (n, 3, 3). node_samples: (m,). acceleration: (n, 3), any unit. Pauses are
    felt by the accelerometer where it can; elsewhere they are looked for at the nodes. Raises ScanError where time runs
    backwards.
    """
    backwards = np.flatnonzero(np.diff(time) < 0)
    if len(backwards):
        raise ScanError(f"the device's clock runs backwards after sample {backwards[0] + 1}")
    felt = None if acceleration is None else felt_pauses(time, frames, acceleration)
    still = _pauses_at_nodes(time, frames, node_samples) if felt is None else felt
    return NOMINAL_SPEED * np.cumsum(np.where(still, 0.0, np.diff(time, prepend=time[0])))


def _pauses_at_nodes(time: Floats, frames: Floats, node_samples: Ints) -> Bools:
    """Samples (n,) in which the device did not turn, before and after a node, as far as that may be a pause."""
    still = np.zeros(len(time), bool)
    ends = np.unique(np.concatenate([[0], node_samples, [len(time) - 1]]))
    for first, last in pairwise(ends.tolist()):
        limit = LONGEST_PAUSE * (time[last] - time[first])
        after = _still(frames[first : last + 1]) & (time[first : last + 1] - time[first] <= limit)
        before = _still(frames[first : last + 1][::-1])[::-1] & (time[last] - time[first : last + 1] <= limit)
        still[first + 1 : last + 1] = after[1:] | before[:-1]
    return still


def felt_pauses(time: Floats, frames: Floats, acceleration: Floats) -> Bools | None:
    """Samples (n,) in which the device neither turned nor was shaken as it is while a hand moves it; None: not known.

    Nothing is known where moving does not shake it, as on a rail: a straight line turns nothing either. Shaking is the
    second difference of the acceleration (n, 3) over PAUSE_WINDOW; its least is that of the sensor.
    """
    step = float(np.median(np.diff(time))) if len(time) > 2 else 0.0
    width = round(PAUSE_WINDOW / step) | 1 if step > 0 else 0
    if width < 5 or len(time) < 4 * width:
        return None
    shaking = np.sum(np.diff(acceleration, 2, axis=0, prepend=acceleration[:1], append=acceleration[-1:]) ** 2, axis=1)
    padded = np.pad(shaking, width // 2, "edge")
    strength = np.sqrt(np.convolve(padded, np.full(width, 1 / width), "valid"))
    least = float(np.percentile(strength, 5))
    if least == 0.0 or np.median(strength) < SHAKEN * least:
        return None
    still = np.zeros(len(time), bool)
    quiet = np.flatnonzero(np.diff(np.pad(strength < QUIET * least, 1).astype(int))).reshape(-1, 2)
    for first, last in quiet:
        if last - first > width and _still(frames[[first, last - 1]]).all():
            still[max(first - width // 2, 0) : last + width // 2] = True
    return still


def _still(frames: Floats) -> Bools:
    """Which frames (n, 3, 3), from the first on without a break, are turned by less than STILL against the first."""
    cosine = (np.einsum("ij,nij->n", frames[0], frames) - 1) / 2
    near = cosine > np.cos(STILL)
    result: Bools = np.logical_and.accumulate(near)
    return result
