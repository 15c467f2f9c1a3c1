"""Pictures of what comes from devices before curves are made of it."""

from dataclasses import replace
from datetime import date

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from benchmarks.data import exact_network
from benchmarks.measuring import Floats, paired_motion
from benchmarks.noisy import partners
from benchmarks.pictures.canvas import BLUE, GREY, ORANGE, draw_network, figure, plane, space
from tracemesh.errors import InputError
from tracemesh.geometry.curves.reconstruction import reconstruct_network
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.sensing.calibration import fit_calibration
from tracemesh.geometry.sensing.fusion import frames_from_imu
from tracemesh.geometry.sensing.magnetic_field import field_at
from tracemesh.geometry.sensing.orientation import ReferenceField, angles_between, frames_from_vectors
from tracemesh.geometry.sensing.wheel_offset import at_wheel
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan

FIELD = ReferenceField.from_inclination(np.radians(61.0))


def wheel_offset() -> Figure:
    """A wheel that runs above and beside a great circle of a sphere: the curve from its distances, and corrected."""
    drawn, radius = figure(), 0.1
    turn = np.linspace(0, 2 * np.pi, 400)
    frames = Rotation.from_rotvec(np.outer(turn, [0, 0, 1])).as_matrix() @ np.array(
        [[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]
    )
    for k, height in enumerate((0.01, -0.01)):
        title = (
            f"sphere of {1e3 * radius:.0f} mm, wheel {1e3 * abs(height):.0f} mm {'above' if height > 0 else 'below'}"
        )
        axes, offset = plane(drawn, 121 + k, title, "mm", "mm"), np.array([0.0, height, 0.0])
        axes.set_aspect("equal")
        wheel = (radius + height) * turn
        curves = (
            ("the wheel's distances", wheel, ORANGE),
            ("at the sensors", at_wheel(wheel, frames, offset).distance, BLUE),
        )
        axes.plot(*(1e3 * radius * np.array([np.cos(turn), np.sin(turn)])), color=GREY, lw=4, label="truth")
        for label, distance, colour in curves:
            steps = np.diff(distance)[:, None] * (frames[1:, :2, 0] + frames[:-1, :2, 0]) / 2
            points = np.array([radius, 0]) + np.pad(np.cumsum(steps, axis=0), ((1, 0), (0, 0)))
            axes.plot(*(1e3 * points.T), color=colour, lw=1, label=label)
        axes.legend(fontsize=7, frameon=False)
    return drawn


def fusion() -> Figure:
    """Orientation of a moving phone from its vectors alone and fused with its gyroscope."""
    time, rate, acceleration, magnetic, pose = _shaken_phone()
    drawn = figure()
    axes = plane(drawn, 111, "error of a phone's orientation while a hand moves it", "s", "degrees")
    alone = frames_from_vectors(acceleration, magnetic, FIELD)
    fused = frames_from_imu(time, rate, acceleration, magnetic)
    for label, frames, colour in (("vectors alone", alone, ORANGE), ("fused with the gyroscope", fused, BLUE)):
        error = np.degrees((Rotation.from_matrix(frames) * pose.inv()).magnitude())
        axes.plot(time, error, lw=1, color=colour, label=f"{label}: rms {np.sqrt(np.mean(error**2)):.1f}°")
    axes.legend(fontsize=7, frameon=False)
    return drawn


def magnetic_field() -> Figure:
    """Inclination of the field from pole to pole along a few meridians."""
    drawn = figure()
    axes = plane(drawn, 111, "inclination of the magnetic field (World Magnetic Model)", "latitude, degrees", "degrees")
    latitudes = np.arange(-88.0, 89.0, 2.0)
    for longitude, colour in ((5.72, BLUE), (-75.0, ORANGE), (140.0, GREY)):
        line = [_inclination(latitude, longitude) for latitude in latitudes]
        axes.plot(latitudes, line, lw=1.4, color=colour, label=f"longitude {longitude:g}°")
    axes.plot(45.19, _inclination(45.19, 5.72), "o", ms=5, color=BLUE)
    axes.annotate("Grenoble", (45.19, _inclination(45.19, 5.72)), (4, -10), textcoords="offset points", fontsize=8)
    axes.legend(fontsize=7, frameon=False)
    return drawn


def calibration() -> Figure:
    """Lengths of a magnetometer's vectors and the heading that they give, before and after calibration."""
    pose, acceleration, magnetic = _turned_device()
    fit = fit_calibration(acceleration, magnetic)
    corrected = fit.magnetometer.correction(magnetic) @ fit.alignment.T
    drawn = figure()
    lengths = plane(drawn, 121, "magnetometer in all directions", "x", "y")
    heading = plane(drawn, 122, "error of the orientation", "degrees", "part of the readings")
    up = fit.accelerometer.correction(acceleration)
    for label, a, m, colour in (("as measured", acceleration, magnetic, ORANGE), ("calibrated", up, corrected, BLUE)):
        lengths.plot(m[:, 0], m[:, 1], ".", ms=2, color=colour)
        angle = float(np.mean(angles_between(a, m))) - np.pi / 2
        frames = frames_from_vectors(a, m, ReferenceField.from_inclination(angle))
        error = np.sort(np.degrees((Rotation.from_matrix(frames) * pose.inv()).magnitude()))
        middle = f"{label}: median {np.median(error):.1f}°"
        heading.plot(error, np.linspace(0, 1, len(error)), lw=1.4, color=colour, label=middle)
    lengths.set_aspect("equal")
    heading.set_xscale("log")
    heading.legend(fontsize=7, frameon=False)
    return drawn


def sketch() -> Figure:
    """A network drawn at another speed on every segment, taken as constant speed and as unknown speeds."""
    drawn = figure()
    uneven = _at_uneven_speed(exact_scan(leaf(), 0.01))
    truth = exact_network(leaf())
    measured = Scan((exact_scan(leaf(), 0.01).curves[0], *(replace(c, timed=True) for c in uneven.curves[1:])))
    for position, title, scan in (
        (121, "constant speed assumed", uneven),
        (122, "durations; the boundary measured", measured),
    ):
        network = reconstruct_network(scan).network
        there = partners(network, truth)
        moved = replace(network, points=paired_motion(network.points, there).apply(network.points))
        error = 1e3 * np.linalg.norm(moved.points - there, axis=1).mean()
        axes = space(drawn, truth.points, position, f"{title}: mean error {error:.1f} mm")
        draw_network(axes, truth, GREY, 3.0)
        draw_network(axes, moved, BLUE if position == 122 else ORANGE)
    return drawn


def _inclination(latitude: float, longitude: float) -> float:
    try:
        _, north, up = field_at(latitude, longitude, date(2026, 1, 1)).magnetic
    except InputError:  # too steep for a compass
        return float("nan")
    return float(np.degrees(np.arctan2(-up, north)))


def _at_uneven_speed(scan: Scan) -> Scan:
    """Every segment's lengths multiplied by a factor of its own."""
    generator = np.random.default_rng(3)

    def stretched(curve: CurveScan) -> CurveScan:
        ends = curve.distance[curve.node_samples]
        factors = np.exp(generator.normal(0, 0.25, len(ends) - 1))
        there = np.concatenate([[0.0], np.cumsum(np.diff(ends) * factors)])
        return replace(curve, distance=np.interp(curve.distance, ends, there))

    return Scan(tuple(map(stretched, scan.curves)))


def _turned_device() -> tuple[Rotation, Floats, Floats]:
    """Poses all around, and what sensors with offsets, scales and a turned magnetometer measure in them."""
    generator = np.random.default_rng(1)
    pose = Rotation.random(1500, rng=generator)
    up, field = pose.inv().apply([0.0, 0.0, 1.0]), pose.inv().apply(FIELD.magnetic)
    acceleration = up @ np.diag([1.02, 0.99, 1.03]) + [0.02, -0.01, 0.015]
    iron = np.array([[1.15, 0.08, 0.0], [0.08, 0.9, -0.05], [0.0, -0.05, 1.0]])
    magnetic = Rotation.from_rotvec([0.05, -0.02, 0.06]).apply(field) @ iron + [0.35, -0.2, 0.1]
    noise = generator.normal(0.0, 0.01, (2, len(up), 3))
    return pose, acceleration + noise[0], magnetic + noise[1]


def _shaken_phone() -> tuple[Floats, Floats, Floats, Floats, Rotation]:
    """Time, rotation rate, acceleration and magnetic field of a phone in a hand, and how it truly turns; SI units."""
    generator = np.random.default_rng(1)
    time = np.arange(0, 15, 1 / 60)
    knots = np.arange(0.0, 17.0)
    turns = np.cumsum(generator.normal(0, [0.15, 0.15, 0.5], (len(knots), 3)), axis=0)
    path = RotationSpline(knots, Rotation.from_rotvec(turns))
    pose = path(time)
    rate = (pose.inv() * path(time + 1e-5)).as_rotvec() / 1e-5
    beats = np.arange(0, 16, 0.5)
    shaken = CubicSpline(beats, generator.normal(0, 0.04, (len(beats), 3)))(time, 2)
    acceleration = pose.inv().apply(shaken + np.array([0, 0, 9.81])) + generator.normal(0, 0.05, (len(time), 3))
    magnetic = pose.inv().apply(FIELD.magnetic) + generator.normal(0, 0.01, (len(time), 3))
    return time, rate + generator.normal(0, 0.005, rate.shape) + 0.01, acceleration, magnetic, pose
