"""Placement and resampling: nodes are rows, steps are even, quadratics are kept, odd curves do no harm."""

import numpy as np
import pytest

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.cleaning import clean_curve, clean_curves
from tracemesh.geometry.curves.placement import measured_layout, place_curve, uniform_layout
from tracemesh.geometry.curves.resampling import fit_matrix, resample
from tracemesh.geometry.rotations import exp, log
from tracemesh.geometry.scan import CurveScan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan


def scan_of(arc: np.ndarray, marks: list[int], ids: list[int], closed: bool = False) -> CurveScan:
    """A helix of a turn per metre, or a circle of length 1 when closed."""
    rotation = exp(2 * np.pi * arc[:, None] * np.array([0.0, 0.0, 1.0])) @ exp(
        np.array([0.0, 0.0 if closed else 0.5, 0.0])
    )
    node_samples, node_ids = np.array(marks, np.int64), np.array(ids, np.int64)
    return CurveScan(arc, rotation[:, :, 0], rotation[:, :, 1], node_samples, node_ids, closed=closed)


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_nodes_are_rows_and_steps_are_even(name: str) -> None:
    curves = [place_curve(c) for c in clean_curves(exact_scan(SHAPES[name](), 0.004).curves)]
    layout, step = uniform_layout(curves, 0.02), 0.02
    for i, curve in enumerate(curves):
        own = (layout.marks >= layout.first[i]) & (layout.marks < layout.first[i + 1])
        np.testing.assert_allclose(layout.arc[layout.marks[own]], curve.marks, atol=1e-15)
    for start, end in layout.segment_rows:
        h = np.diff(layout.arc[start : end + 1])
        np.testing.assert_allclose(h, h[0], rtol=1e-9)
        assert abs(1 / h[0] - 1 / step) <= 0.51 / (layout.arc[end] - layout.arc[start])
    assert layout.lengths.sum() == pytest.approx(sum(c.length for c in curves))
    assert layout.segment_lengths.sum() == pytest.approx(layout.lengths.sum())


@pytest.mark.parametrize("prefilter", [0.01, 0.2])
@pytest.mark.parametrize("spacing", ["dense", "sparse"])
def test_quadratics_are_reproduced_from_uneven_samples(spacing: str, prefilter: float) -> None:
    random = np.random.default_rng(0)
    arc = np.sort(random.uniform(0, 1, 400 if spacing == "dense" else 30))
    places = np.linspace(arc[0], arc[-1], 60)
    fit = fit_matrix(arc, places, prefilter)
    for power in range(3):
        np.testing.assert_allclose(fit @ arc**power, places**power, atol=1e-6)


def straight(noise: float) -> CurveScan:
    """A metre along x whose frames do not turn, but for noise, rad."""
    turned = exp(np.random.default_rng(0).normal(0, noise, (1001, 3)))
    arc, ends = np.linspace(0, 1, 1001), np.array([0, 1000])
    return CurveScan(arc, turned[:, :, 0], turned[:, :, 1], ends, np.array([0, 1]))


def error_of(noise: float, prefilter: float | None) -> float:
    """Root mean square error, rad, of the straight line's frames after resampling to steps of 2 cm."""
    placed = [place_curve(clean_curve(straight(noise), 0))]
    samples = resample(placed, uniform_layout(placed, 0.02), 0.02, prefilter)
    return float(np.sqrt(np.mean(log(samples.frames) ** 2)))


def test_the_automatic_prefilter_is_half_a_step() -> None:
    placed = [place_curve(clean_curve(scan_of(np.linspace(0, 1, 1001), [0, 1000], [0, 1]), 0))]
    layout = uniform_layout(placed, 0.02)
    automatic, given = resample(placed, layout, 0.02), resample(placed, layout, 0.02, 0.01)
    np.testing.assert_array_equal(automatic.frames, given.frames)


def test_a_wider_prefilter_averages_more_noise_away() -> None:
    errors = [error_of(0.02, prefilter) for prefilter in (0.005, 0.02, 0.08)]
    ratios = np.divide(errors[:-1], errors[1:])
    assert (ratios > 1.5).all(), errors  # twice, were the ends like the rest


def test_a_straight_line_stays_exact_whatever_the_prefilter() -> None:
    assert max(error_of(0.0, prefilter) for prefilter in (None, 0.001, 0.05, 0.5)) < 1e-12


def test_frames_converge_in_the_third_order_of_the_step_at_least() -> None:
    errors = []
    for step in (0.04, 0.02):
        placed = [place_curve(clean_curve(scan_of(np.linspace(0, 1, 1001), [0, 1000], [0, 1]), 0))]
        samples = resample(placed, uniform_layout(placed, step), step)
        truth = scan_of(samples.layout.arc, [0], [0])
        exact = np.stack([truth.tangent, truth.normal, np.cross(truth.tangent, truth.normal)], axis=-1)
        errors.append(np.linalg.norm(log(np.swapaxes(exact, 1, 2) @ samples.frames), axis=1).max())
    assert np.log2(errors[0] / errors[1]) > 2.9


def test_a_closed_curve_is_periodic_and_does_not_care_where_it_was_started() -> None:
    arc = np.linspace(0, 1, 401)
    curves = [scan_of(arc, [0, 400], [7, 7], closed=True), scan_of(arc, [130], [7], closed=True)]
    results = []
    for curve in curves:
        placed = [place_curve(clean_curve(curve, 0))]
        samples = resample(placed, uniform_layout(placed, 0.02), 0.02)
        np.testing.assert_array_equal(samples.frames[0], samples.frames[-1])
        assert samples.layout.nodes.tolist() == [0, 0]
        results.append(samples.frames)
    moved = exp(np.array([0.0, 0.0, -2 * np.pi * arc[130]])) @ results[1]
    np.testing.assert_allclose(moved, results[0], atol=2e-6)  # the pause at a node counts as one sample, not two


def test_ends_outside_the_nodes_are_cut_and_loose_ends_kept() -> None:
    arc = np.linspace(3, 4, 101)
    cut = place_curve(clean_curve(scan_of(arc, [10, 60], [4, 2]), 0))
    assert (cut.marks.tolist(), cut.nodes.tolist()) == ([0.0, pytest.approx(0.5)], [4, 2])
    assert cut.arc[0] == 0 and cut.arc[-1] == cut.length
    under_way = place_curve(clean_curve(scan_of(arc, [1], [4]), 0))
    assert under_way.nodes.tolist() == [4, -1] and under_way.length == pytest.approx(0.99)
    free = place_curve(clean_curve(scan_of(arc, [], []), 0))
    assert free.nodes.tolist() == [-1, -1] and free.length == pytest.approx(1.0)


def test_a_closed_curve_without_nodes_has_no_node() -> None:
    layout = uniform_layout([place_curve(clean_curve(scan_of(np.linspace(0, 1, 101), [], [], closed=True), 0))], 0.1)
    assert layout.is_node.tolist() == [False]
    assert layout.nodes.tolist() == [0, 0]


def test_segments_shorter_than_a_step_are_one_edge() -> None:
    arc = np.linspace(0, 1, 1001)
    placed = [place_curve(clean_curve(scan_of(arc, [0, 1, 500, 1000], [0, 1, 2, 3]), 0))]
    samples = resample(placed, uniform_layout(placed, 0.05), 0.05)
    assert np.diff(samples.layout.marks).tolist() == [1, 10, 10]
    assert np.isfinite(samples.frames).all()


def test_a_segment_that_returns_to_its_node_has_three_edges_at_least() -> None:
    arc = np.linspace(0, 1, 1001)
    placed = [place_curve(clean_curve(scan_of(arc, [0, 500, 520, 1000], [0, 1, 1, 2]), 0))]
    assert np.diff(uniform_layout(placed, 0.05).marks).tolist() == [10, 3, 10]
    free = [place_curve(clean_curve(scan_of(arc, [], []), 0))]
    assert np.diff(uniform_layout(free, 0.9).marks).tolist() == [1]


@pytest.mark.parametrize("count", [2, 3, 4, 5])
@pytest.mark.parametrize("closed", [False, True])
def test_very_few_samples_give_finite_rotations(count: int, closed: bool) -> None:
    placed = [place_curve(clean_curve(scan_of(np.linspace(0, 1, count), [0, count - 1], [0, 0], closed), 0))]
    samples = resample(placed, uniform_layout(placed, 0.1), 0.1)
    np.testing.assert_allclose(np.linalg.det(samples.frames), 1, atol=1e-12)


def test_a_curve_with_nothing_between_its_nodes_is_refused() -> None:
    curve = scan_of(np.linspace(0, 1, 11), [3, 4], [0, 1])
    distance = curve.distance.copy()
    distance[4] = distance[3] + 1e-12
    placed = place_curve(
        clean_curve(CurveScan(distance, curve.tangent, curve.normal, curve.node_samples, curve.node_ids), 0)
    )
    assert len(measured_layout([placed]).arc) == 2
    lone = scan_of(np.array([0.0, 1.0]), [1], [0])
    assert place_curve(clean_curve(lone, 0)).nodes.tolist() == [-1, 0]
    with pytest.raises(ScanError, match="curve 5 has no length"):
        clean_curve(scan_of(np.zeros(3), [0], [0]), 4)
