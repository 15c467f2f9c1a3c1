"""Fixed arrays: how long one reading takes, and how far it is from the truth."""

import numpy as np

from benchmarks.data import Data
from benchmarks.measuring import Floats, warm_seconds
from benchmarks.table import Cell, Column, Table
from tracemesh.geometry.curves.array_network import ArraySolver
from tracemesh.geometry.sensing.orientation import ReferenceField, frames_from_vectors
from tracemesh.geometry.simulated.moving_arrays import ARRAYS, NOISE, MovingArray
from tracemesh.jobs.readings import DRAWN_PER_GAP

COLUMNS = (
    Column("array"),
    Column("sensors", "d"),
    Column("points", "d"),
    Column("prepared once, ms", ".1f"),
    Column("a reading, ms", ".2f"),
    Column("error without noise, %", ".3f"),
    Column("error with noise, %", ".3f"),
)

NOTES = (
    f"""The virtual arrays of `tracemesh-bridge virtual-array`, drawn with {DRAWN_PER_GAP} points from sensor to
    sensor as the live view does. Error: mean distance of the sensors from the truth, both centred, over the diagonal
    of the truth's bounding box, mean over all moments; noise as of a good sensor ({100 * NOISE:g} % of each vector,
    per axis).""",
)


def arrays(data: Data, moments: int = 40, repeats: int = 30) -> Table:
    """Table of one row per built-in array."""
    rows = tuple(
        _row(name, make(), 0.21 * np.arange(moments, dtype=np.float64), repeats) for name, make in ARRAYS.items()
    )
    return Table("arrays", "Readings of fixed arrays", COLUMNS, rows, NOTES)


def _row(name: str, moving: MovingArray, times: Floats, repeats: int) -> tuple[Cell, ...]:
    step = float(moving.array.curves[0].spacing[0]) / DRAWN_PER_GAP
    solver, rotations = ArraySolver(moving.array, step), moving.rotations(0.5)
    prepared = warm_seconds(lambda: ArraySolver(moving.array, step), repeats)
    solved = warm_seconds(lambda: solver.solve(rotations), repeats)
    errors = (100 * float(np.mean([_error(solver, moving, time, noise) for time in times])) for noise in (0.0, NOISE))
    return (name, moving.array.sensor_count, solver.layout.size, 1e3 * prepared, 1e3 * solved, *errors)


def _error(solver: ArraySolver, moving: MovingArray, time: float, noise: float) -> float:
    field, generator = ReferenceField(), np.random.default_rng(int(1e3 * time))
    found = solver.solve(frames_from_vectors(*moving.vectors(time, field, noise, generator), field)).sensors
    truth = moving.positions(time)
    truth -= truth.mean(axis=0)
    return float(np.linalg.norm(found - truth, axis=1).mean() / np.linalg.norm(np.ptp(truth, axis=0)))
