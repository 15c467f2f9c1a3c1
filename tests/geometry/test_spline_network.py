"""Spline networks: exact curves from uneven points, tangent planes at nodes, even spacing."""

import numpy as np
import pytest

from tracemesh.errors import NetworkError
from tracemesh.geometry.curves.spline_network import resample_network
from tracemesh.geometry.network import CurveNetwork, Segment
from tracemesh.geometry.simulated.shapes import SHAPES


def uneven(name: str, step: float, seed: int = 0) -> CurveNetwork:
    """An exact network of which two points in three are gone at random; ends of segments stay."""
    full, random = SHAPES[name]().network(step / 3), np.random.default_rng(seed)
    segments = []
    for s in full.segments:
        kept = np.sort(random.choice(np.arange(1, len(s.points) - 1), (len(s.points) - 2) // 3, replace=False))
        segments.append(Segment(s.points[np.r_[0, kept, len(s.points) - 1]], s.boundary, s.curve))
    return CurveNetwork(full.points, full.normals, full.nodes, tuple(segments))


def distances(network: CurveNetwork, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Distance (n,) of every inner point from the true curve, and of its normal from the true one there."""
    far, turned = [], []
    curves = SHAPES[name]().curves
    dense = [c.at(np.linspace(0, c.length, 60001)) for c in curves]
    for s in network.segments:
        points, frames = dense[s.curve]
        own = network.points[s.points]
        nearest = [int(np.sum((points - p) ** 2, axis=1).argmin()) for p in own]
        offset = own - points[nearest]
        along = frames[nearest, :, 0]
        far.append(np.linalg.norm(offset - np.sum(offset * along, axis=1, keepdims=True) * along, axis=1))
        turned.append(np.linalg.norm(network.normals[s.points] - frames[nearest, :, 1], axis=1))
    return np.concatenate(far), np.concatenate(turned)


@pytest.mark.parametrize("name", ["leaf", "egg"])
def test_splines_converge_to_the_true_curves(name: str) -> None:
    errors = []
    for step in (0.06, 0.03):
        far, turned = distances(resample_network(uneven(name, step), 0.02), name)
        errors.append([far.mean(), turned.mean()])
    order = np.log2(np.array(errors[0]) / errors[1])
    assert order[0] > 2.0  # gaps are random: the widest, not the mean, sets the error
    assert order[1] > 1.5
    assert errors[1][0] < 2e-5
    assert errors[1][1] < 0.01


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_segments_are_even_and_nodes_stay(name: str) -> None:
    network = uneven(name, 0.03)
    result = resample_network(network, 0.01)
    np.testing.assert_array_equal(result.points[result.nodes], network.points[network.nodes])
    np.testing.assert_array_equal(result.normals[result.nodes], network.normals[network.nodes])
    for old, new in zip(network.segments, result.segments, strict=True):
        np.testing.assert_array_equal(result.points[new.points[[0, -1]]], network.points[old.points[[0, -1]]])
        chords = np.linalg.norm(np.diff(result.points[new.points], axis=0), axis=1)
        assert np.ptp(chords) < 0.01 * chords.mean()
        assert 0.6 < chords.mean() / 0.01 < 1.7
        assert (new.boundary, new.curve) == (old.boundary, old.curve)
    used = np.bincount(np.concatenate([s.points[1:-1] for s in result.segments]), minlength=len(result.points))
    assert used.max() == 1
    np.testing.assert_allclose(np.linalg.norm(result.normals, axis=1), 1, atol=1e-12)


def test_curves_leave_nodes_in_the_tangent_plane_and_pass_them_smoothly() -> None:
    result = resample_network(uneven("leaf", 0.06), 0.001)
    ways: dict[tuple[int, int], list[np.ndarray]] = {}
    for s in result.segments:
        for i, j in ((0, 1), (-1, -2)):
            way = result.points[s.points[j]] - result.points[s.points[i]]
            way /= np.linalg.norm(way)
            assert abs(way @ result.normals[s.points[i]]) < 5e-3
            ways.setdefault((int(s.points[i]), s.curve), []).append(way)
    through = [w for w in ways.values() if len(w) == 2]
    assert len(through) > 5
    assert max(np.linalg.norm(a + b) for a, b in through) < 0.03


def test_a_closed_curve_without_nodes_is_periodic() -> None:
    angle = np.sort(np.random.default_rng(0).uniform(0, 2 * np.pi, 40))
    points = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(40)])
    loop = CurveNetwork(points, points, np.empty(0, np.int64), (Segment(np.r_[0:40, 0], True, 0),))
    result = resample_network(loop, 0.05)
    assert len(result.nodes) == 0
    assert result.segments[0].points[0] == result.segments[0].points[-1]
    np.testing.assert_allclose(np.linalg.norm(result.points, axis=1), 1, atol=2e-3)
    inside = result.segments[0].points[1:-1]
    np.testing.assert_allclose(result.normals[inside], result.points[inside], atol=0.02)


def test_points_that_are_one_are_refused() -> None:
    network = uneven("leaf", 0.05)
    points = network.points.copy()
    first = network.segments[0].points
    points[first[2]] = points[first[1]]
    with pytest.raises(NetworkError, match="neighbouring points"):
        resample_network(CurveNetwork(points, network.normals, network.nodes, network.segments), 0.01)
