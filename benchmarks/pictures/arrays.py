"""Pictures of fixed arrays of sensors."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from benchmarks.measuring import Floats
from benchmarks.pictures.canvas import BLUE, GREY, ORANGE, Axes, draw_network, figure, space
from tracemesh.geometry.curves.array_network import ArraySolver
from tracemesh.geometry.simulated.moving_arrays import MovingArray, comb, lattice, ribbon

MOMENTS: dict[str, tuple[Callable[[], MovingArray], float]] = {
    "a ribbon rolls up": (ribbon, 4.0),
    "a comb": (comb, 0.6),
    "a lattice waves": (lattice, 1.3),
}
THICKNESS = 0.05
"""m by which what is drawn of a flat shape has to be deep."""
ROOM = 1.15
"""Size of the space drawn over that of the array."""


def array_network() -> Figure:
    """Ribbon, comb and lattice as their sensors give them, over the truth in grey."""
    drawn = figure()
    for place, (name, (make, time)) in enumerate(MOMENTS.items()):
        moving = make()
        around = ROOM * _centred(moving, time)
        around = np.concatenate([around, [[0, THICKNESS, 0], [0, -THICKNESS, 0]]])
        _draw(space(drawn, around, 131 + place, f"{name}: {len(moving.flat)} sensors"), moving, time)
    return drawn


def _draw(axes: Axes, moving: MovingArray, time: float) -> None:
    solved = ArraySolver(moving.array, 0.005).solve(moving.rotations(time))
    for curve in moving.array.curves:
        along = np.linspace(0, 1, 200)[:, None] * (len(curve.sensors) - 1)
        columns = [np.interp(along[:, 0], range(len(curve.sensors)), c) for c in moving.flat[curve.sensors].T]
        middle = moving.positions(time).mean(axis=0)
        axes.plot(*(moving.positions(time, np.stack(columns, axis=1)) - middle).T, color=GREY, lw=3)
    draw_network(axes, solved.network, BLUE, 1.2)
    axes.scatter(*solved.sensors.T, s=10, color=ORANGE, depthshade=False, zorder=4)


def _centred(moving: MovingArray, time: float) -> Floats:
    points = moving.positions(time)
    result: Floats = points - points.mean(axis=0)
    return result
