"""Laws of fixed arrays: exact where the rate of rotation is constant, of high order elsewhere, still under rotation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.array_network import ArrayNetwork, ArraySolver
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.sensor_array import SensorArray, SensorCurve
from tracemesh.geometry.simulated.moving_arrays import ALONG_X, ALONG_Y, MovingArray, comb, lattice, ribbon
from tracemesh.geometry.surfaces.surface import span_surface

Floats = NDArray[np.float64]


def helix(radius: float, pitch: float, arc: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) and frames [t N B] (n, 3, 3) with the normal towards the axis; a circle without pitch."""
    rate = 1 / np.hypot(radius, pitch)
    c, s, o = np.cos(rate * arc), np.sin(rate * arc), np.ones_like(arc)
    points = np.stack([radius * c, radius * s, pitch * rate * arc], axis=1)
    tangent = np.stack([-radius * rate * s, radius * rate * c, pitch * rate * o], axis=1)
    normal = np.stack([-c, -s, 0 * o], axis=1)
    return points, np.stack([tangent, normal, np.cross(tangent, normal)], axis=2)


def one_curve(spacing: Floats, closed: bool = False) -> SensorArray:
    sensors = np.arange(len(spacing) + (not closed))
    return SensorArray((SensorCurve(sensors, spacing, mounts(np.eye(3), len(sensors)), closed=closed),))


def mounts(mounting: Floats, sensors: int) -> Floats:
    return np.tile(mounting, (sensors, 1, 1))


def centred(points: Floats) -> Floats:
    return points - points.mean(axis=0)


spacings = st.lists(st.floats(0.02, 0.2), min_size=1, max_size=12).map(np.array)


@given(spacings, st.floats(0.15, 5.0), st.floats(-1.0, 1.0))
@settings(max_examples=50, deadline=None)
def test_a_ribbon_on_a_helix_is_exact_at_its_sensors(spacing: Floats, radius: float, pitch: float) -> None:
    points, frames = helix(radius, pitch, np.concatenate([[0.0], np.cumsum(spacing)]))
    solved = ArraySolver(one_curve(spacing), 0.01).solve(frames)
    assert solved.sensors == pytest.approx(centred(points), abs=1e-6 * spacing.sum())


def test_a_ribbon_on_a_line_is_a_line_to_the_last_bit() -> None:
    frames = np.tile(np.eye(3), (8, 1, 1))
    solved = ArraySolver(one_curve(np.full(7, 0.1)), 0.01).solve(frames)
    assert solved.sensors[:, 0] == pytest.approx(0.1 * np.arange(8) - 0.35, abs=1e-15)
    assert not solved.network.points[:, 1:].any()


def test_a_belt_of_sensors_closes() -> None:
    spacing = np.array([0.1, 0.07, 0.13, 0.1, 0.12])
    radius = spacing.sum() / (2 * np.pi)
    points, frames = helix(radius, 0.0, np.cumsum(spacing) - spacing)
    solved = ArraySolver(one_curve(spacing, closed=True), 0.005).solve(frames)
    around = np.linalg.norm(solved.network.points - (solved.sensors - points)[0], axis=1)
    assert around == pytest.approx(radius, abs=1e-7)
    assert np.abs(solved.gaps).max() < 1e-7
    first, *_, last = solved.network.segments[0].points
    assert first == last


def test_few_sensors_err_in_the_fourth_order_of_their_spacing() -> None:
    errors = []
    for sensors in (9, 17, 33):
        array = lattice(2, sensors, 0.4 / (sensors - 1))
        errors.append(np.abs(shape_error(array, 0.3)).max())
    assert errors[0] / errors[1] > 8
    assert errors[1] / errors[2] > 10


def shape_error(array: MovingArray, time: float) -> Floats:
    solved = ArraySolver(array.array, 0.002).solve(array.rotations(time))
    return solved.sensors - centred(array.positions(time))


@pytest.mark.parametrize(("make", "worst"), [(ribbon, 1e-7), (comb, 5e-3), (lattice, 1e-3)])
def test_a_moving_array_follows_the_truth(make: type[MovingArray], worst: float) -> None:
    array = make()
    for time in (0.0, 1.0, 3.3):
        size = np.ptp(array.positions(time), axis=0).max()
        assert np.abs(shape_error(array, time)).max() < worst * size


def test_sensors_keep_their_distances_on_the_moving_sheet() -> None:
    """Along short steps of the flat sheet the surface is as long as the sheet: it bends, but does not stretch."""
    array = lattice()
    flat = np.stack([np.linspace(-0.1, 0.1, 2001), np.linspace(0.05, -0.02, 2001)], axis=1)
    steps = np.linalg.norm(np.diff(array.positions(1.7, flat), axis=0), axis=1)
    assert steps.sum() == pytest.approx(np.hypot(0.2, 0.07), rel=1e-7)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_a_turned_array_is_the_same_shape_turned(seed: int) -> None:
    turn = Rotation.random(rng=seed).as_matrix()
    array = comb()
    rotations = array.rotations(0.4) @ Rotation.from_rotvec(0.1 * np.eye(3)[0]).as_matrix()
    solver = ArraySolver(array.array, 0.02)
    plain, turned = solver.solve(rotations), solver.solve(turn @ rotations)
    assert turned.network.points == pytest.approx(plain.network.points @ turn.T, abs=1e-12)
    assert turned.network.normals == pytest.approx(plain.network.normals @ turn.T, abs=1e-12)


def test_a_closed_curve_may_begin_anywhere() -> None:
    """A flat ring with a diameter: which of the ring's sensors is named first does not matter."""
    angle = 2 * np.pi * np.arange(6) / 6
    rotations = np.tile(np.eye(3), (7, 1, 1))  # all sensors lie flat and point East
    along = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    mounting = np.stack([along, np.tile([0.0, 0, 1], (6, 1)), np.cross(along, [0.0, 0, 1])], axis=2)
    gap, diameter = np.full(6, 0.2 * np.pi / 3), SensorCurve(np.array([3, 6, 0]), np.full(2, 0.2), mounts(ALONG_X, 3))
    points = 0.2 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    for first in range(6):
        ring = SensorCurve(np.arange(6), gap, mounting, closed=True).starting_at(first)
        solved = ArraySolver(SensorArray((ring, diameter)), 0.02).solve(rotations)
        assert solved.sensors[:6] == pytest.approx(points, abs=1e-7)
        assert np.linalg.norm(solved.network.points[:, :2], axis=1).max() == pytest.approx(0.2)


def sphere_patch(rows: int, columns: int, radius: float) -> tuple[SensorArray, Floats, Floats]:
    """Parallels and meridians of a sphere around its equator, its sensors' places and rotations [east north up]."""
    latitude, longitude = np.deg2rad(np.linspace(-40, 40, rows)), np.deg2rad(np.linspace(-50, 50, columns))
    grid = np.arange(rows * columns).reshape(rows, columns)
    curves = [
        SensorCurve(
            row,
            np.full(columns - 1, radius * np.cos(a) * np.ptp(longitude) / (columns - 1)),
            mounts(ALONG_X, columns),
            b,
        )
        for row, a, b in zip(grid, latitude, np.isin(np.arange(rows), (0, rows - 1)), strict=True)
    ]
    spacing = np.full(rows - 1, radius * np.ptp(latitude) / (rows - 1))
    curves += [SensorCurve(c, spacing, mounts(ALONG_Y, rows), i in (0, columns - 1)) for i, c in enumerate(grid.T)]
    a, o = (x.ravel() for x in np.meshgrid(latitude, longitude, indexing="ij"))
    up = np.stack([np.cos(a) * np.cos(o), np.cos(a) * np.sin(o), np.sin(a)], axis=1)
    east = np.stack([-np.sin(o), np.cos(o), 0 * o], axis=1)
    return SensorArray(tuple(curves)), radius * up, np.stack([east, np.cross(up, east), up], axis=2)


def test_a_lattice_on_a_sphere_is_exact_and_its_surface_is_the_sphere() -> None:
    array, points, rotations = sphere_patch(6, 7, 0.3)
    solved = ArraySolver(array, 0.02).solve(rotations)
    assert solved.sensors == pytest.approx(centred(points), abs=1e-7)
    assert np.abs(solved.gaps).max() < 1e-7
    assert solved.network.nodes.tolist() == list(range(42))
    surface = span_surface(solved.network)
    radii = np.linalg.norm(surface.mesh.vertices + points.mean(axis=0), axis=1)
    assert radii == pytest.approx(0.3, rel=2e-3)
    assert euler_number(surface.mesh.faces) == 1


def euler_number(faces: NDArray[np.int64]) -> int:
    edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    return len(np.unique(faces)) - len(edges) + len(faces)


def test_smoothing_is_regression_and_none_of_it_changes_nothing() -> None:
    array, _, rotations = sphere_patch(4, 4, 0.3)
    solver = ArraySolver(array, 0.02)
    plain, smoothed = solver.solve(rotations), solver.solve(rotations, Weights(0.0, 1e-4))
    assert smoothed.sensors == pytest.approx(plain.sensors, abs=1e-4)
    noisy = rotations @ Rotation.from_rotvec(np.random.default_rng(0).normal(0, 0.05, (16, 3))).as_matrix()
    rough, smooth = solver.solve(noisy), solver.solve(noisy, Weights(0.0, 0.1))
    assert unrest(smooth) < 0.8 * unrest(rough)


def unrest(solved: ArrayNetwork) -> float:
    """Second differences of the normals along all curves."""
    return sum(float(np.abs(np.diff(normals_of(solved.network, s), 2, axis=0)).sum()) for s in range(24))


def normals_of(network: CurveNetwork, segment: int) -> Floats:
    return network.normals[network.segments[segment].points]


def test_nodes_are_shared_sensors_and_ends() -> None:
    assert lattice(3, 4).array.nodes.tolist() == list(range(12))
    assert ribbon(8).array.nodes.tolist() == [0, 7]
    array = comb(teeth=3, sensors=4).array
    assert array.nodes.tolist() == [0, 1, 2, 9, 10, 11]
    assert [a.array.encloses for a in (ribbon(), comb(), lattice())] == [False, False, True]
    assert one_curve(np.full(4, 0.1), closed=True).encloses


def test_what_does_not_fit_is_refused() -> None:
    array = one_curve(np.full(3, 0.1))
    with pytest.raises(ScanError, match=r"wanted 4 sensors, got rotations of shape \(3, 3, 3\)"):
        ArraySolver(array, 0.01).solve(np.tile(np.eye(3), (3, 1, 1)))
    with pytest.raises(ScanError, match="a step of 1e-09 m would cut the array's curves into more than"):
        ArraySolver(array, 1e-9)
