"""Exact shapes: a wheel anywhere on the device tells the length of the curve under the sensors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tracemesh.geometry.sensing.wheel_offset import at_wheel
from tracemesh.geometry.simulated.shapes import SHAPES

Floats = NDArray[np.float64]


def circle_on_sphere(radius: float, polar: float, arc: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) and frames (n, 3, 3) along the circle at a polar angle of a sphere, at lengths (n,)."""
    angle = arc / (radius * np.sin(polar))
    sine, cosine, zero = np.sin(angle), np.cos(angle), 0 * angle
    normal = np.column_stack([np.sin(polar) * cosine, np.sin(polar) * sine, zero + np.cos(polar)])
    tangent = np.column_stack([-sine, cosine, zero])
    return radius * normal, np.stack([tangent, normal, np.cross(tangent, normal)], axis=2)


def length_of(points: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


@settings(max_examples=40, deadline=None)
@given(radius=st.floats(0.1, 5), polar=st.floats(0.3, 1.57), height=st.floats(-0.02, 0.05), side=st.floats(-0.02, 0.02))
def test_a_wheel_above_or_beside_a_circle_goes_another_way(
    radius: float, polar: float, height: float, side: float
) -> None:
    arc = np.linspace(0.0, radius, 2001)
    points, frames = circle_on_sphere(radius, polar, arc)
    wheel = length_of(points + frames @ [0.0, height, side])
    found = at_wheel(wheel, frames, np.array([0.0, height, side]))
    np.testing.assert_allclose(found.distance, arc, atol=1e-6 * radius)
    assert found.frames is frames


@pytest.mark.parametrize("height", [-0.03, 0.02, 0.1])
def test_over_a_sphere_lengths_scale_with_the_radius(height: float) -> None:
    arc = np.linspace(0.0, 1.5, 500)
    _, frames = circle_on_sphere(0.5, np.pi / 2, arc)
    found = at_wheel((0.5 + height) / 0.5 * arc, frames, np.array([0.0, height, 0.0]))
    np.testing.assert_allclose(found.distance, arc, atol=1e-12)


def test_on_a_plane_the_height_does_not_matter() -> None:
    frames = np.broadcast_to(np.eye(3), (100, 3, 3))
    distance = np.linspace(0.0, 1.0, 100)
    np.testing.assert_array_equal(at_wheel(distance, frames, np.array([0.0, 0.05, 0.0])).distance, distance)


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_on_any_shape_what_is_left_is_of_second_order(name: str) -> None:
    for curve in SHAPES[name]().curves:
        arc = np.linspace(curve.node_positions[0], curve.node_positions[-1], 3000)
        points, frames = curve.at(arc)
        for size in (0.004, 0.002):
            offset = np.array([0.0, size, size])
            wheel = length_of(points + frames @ offset)
            twist = np.abs(np.gradient(frames, arc, axis=0)).max() * size
            error = np.abs(at_wheel(wheel, frames, offset).distance - (arc - arc[0])).max()
            assert error <= (twist**2 + 1e-5) * np.ptp(arc)


@pytest.mark.parametrize("along", [-0.05, 0.03])
def test_a_wheel_ahead_gets_the_frames_of_where_it_is(along: float) -> None:
    arc = np.linspace(0.0, 2 * np.pi * 0.5, 1001)
    _, frames = circle_on_sphere(0.5, np.pi / 2, arc - along)  # the sensors are that far behind the wheel
    _, there = circle_on_sphere(0.5, np.pi / 2, arc)
    around = at_wheel(arc, frames, np.array([along, 0.0, 0.0]), lap=(0, 1000))
    np.testing.assert_allclose(around.frames, there, atol=1e-9)
    np.testing.assert_allclose(around.distance, arc, atol=1e-12)
    open_ended = at_wheel(arc, frames, np.array([along, 0.0, 0.0]))
    inside = (arc + along >= 0) & (arc + along <= arc[-1])
    np.testing.assert_allclose(open_ended.frames[inside], there[inside], atol=1e-9)
    np.testing.assert_array_equal(
        open_ended.frames[~inside], np.tile(frames[0 if along < 0 else -1], (sum(~inside), 1, 1))
    )


def test_pauses_and_a_step_back_change_nothing() -> None:
    arc = np.concatenate(
        [np.linspace(0, 0.4, 201), np.full(50, 0.4), np.linspace(0.4, 0.39, 6), np.linspace(0.39, 1, 301)]
    )
    _, frames = circle_on_sphere(0.5, np.pi / 2, arc - 0.03)
    _, there = circle_on_sphere(0.5, np.pi / 2, arc)
    found = at_wheel(arc, frames, np.array([0.03, 0.0, 0.0]))
    inside = arc < 0.96
    np.testing.assert_allclose(found.frames[inside], there[inside], atol=1e-6)
    assert (np.diff(arc[found.nearest][inside])[np.diff(arc[inside]) > 0] >= 0).all()


def test_a_frame_of_pure_chance_does_not_move_what_comes_after_it() -> None:
    arc = np.linspace(0.0, 1.5, 500)
    _, frames = circle_on_sphere(0.5, np.pi / 2, arc)
    frames[200] = frames[200] @ np.diag([1.0, -1.0, -1.0])
    found = at_wheel(1.04 * arc, frames, np.array([0.0, 0.02, 0.0]))
    np.testing.assert_allclose(found.distance[201:], arc[201:], atol=2 * 0.04 * arc[1] + 1e-9)
