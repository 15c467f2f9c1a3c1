"""A wheel that does not touch where the sensors measure: what its distances mean for the point that has the frames.

With the frame A = [t N B] of a point P of the curve and the wheel at W = P + A o, rigidly, one step of the wheel is
dW = A (ds e1 + w x o) for a turn w of the device, in its own axes: along the curve ds + w_N o_B - w_B o_N.
"""

from dataclasses import dataclass

import numpy as np

from tracemesh.geometry.rotations import exp, log
from tracemesh.geometry.scan import Floats, Ints


@dataclass(frozen=True)
class AtWheel:
    """A curve as if its sensors were where the wheel touches.

    distance: (n,) m. frames: (n, 3, 3). nearest: (n,) the sample that was measured nearest to each.
    """

    distance: Floats
    frames: Floats
    nearest: Ints


def at_wheel(distance: Floats, frames: Floats, offset: Floats, lap: tuple[int, int] | None = None) -> AtWheel:
    """Distances and frames of the same points of the curve, from a wheel at an `offset` from them.

    distance: (n,) m, as the wheel went. frames: (n, 3, 3), [t N B]. offset: (3,) m along t, N and B, of the wheel from
    the point whose frame is measured. lap: two samples that are the same place of a closed curve, once round.
    """
    along, sideways = float(offset[0]), np.array([0.0, offset[1], offset[2]])
    travelled = distance - _swept(frames, sideways)
    if along == 0.0:
        return AtWheel(travelled, frames, np.arange(len(frames)))
    length = None if lap is None else float(abs(travelled[lap[1]] - travelled[lap[0]]))
    turned, nearest = _shifted(travelled, frames, along, length)
    return AtWheel(travelled, turned, nearest)


def _swept(frames: Floats, arm: Floats) -> Floats:
    """What (n,) of the wheel's way comes from turning about the curve's point rather than from travelling, m.

    A frame of pure chance goes and comes back: what it adds is taken away by the next one.
    """
    turns = log(np.swapaxes(frames[:-1], 1, 2) @ frames[1:])
    return np.concatenate([[0.0], np.cumsum(np.cross(turns, arm)[:, 0])])


def _shifted(travelled: Floats, frames: Floats, along: float, lap: float | None) -> tuple[Floats, Ints]:
    """Frames that were measured where the wheel is, which the sensors reach `along` m later, and their samples.

    Beyond the ends of an open curve nothing was measured: the last frame is kept.
    """
    forward = 1.0 if travelled[-1] >= travelled[0] else -1.0
    way = forward * (travelled - travelled[0])
    farthest = np.maximum.accumulate(way)
    new = np.concatenate([[0], np.flatnonzero(np.diff(farthest) > 0) + 1])
    wanted = way + along
    if lap is not None and lap > 0:
        wanted = wanted % lap
    place = np.interp(wanted, farthest[new], np.arange(len(new)))
    before = place.astype(int)
    one, other = new[before], new[np.minimum(before + 1, len(new) - 1)]
    turn = log(np.swapaxes(frames[one], 1, 2) @ frames[other])
    result = frames[one] @ exp((place - before)[:, None] * turn)
    return result, new[np.round(place).astype(int)]
