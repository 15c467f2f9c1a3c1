"""Positions: exact shapes, order of convergence, the thesis's rows and a dense solver as oracles, pieces named."""

from dataclasses import replace

import numpy as np
import pytest

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.cleaning import clean_curves
from tracemesh.geometry.curves.placement import place_curve, uniform_layout
from tracemesh.geometry.curves.positions import check_connected, segment_vectors, solve_positions
from tracemesh.geometry.curves.quadrature import edge_vectors
from tracemesh.geometry.curves.samples import Layout, NetworkSamples
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan


def layout_of(name: str, step: float) -> Layout:
    return uniform_layout([place_curve(c) for c in clean_curves(exact_scan(SHAPES[name](), step / 2).curves)], step)


def exact_samples(name: str, step: float) -> tuple[NetworkSamples, np.ndarray]:
    """Exact frames at the rows of a uniform layout, and the exact points."""
    layout, curves = layout_of(name, step), SHAPES[name]().curves
    parts = [c.at(layout.arc[layout.first[i] : layout.first[i + 1]]) for i, c in enumerate(curves)]
    return NetworkSamples(layout, np.concatenate([p[1] for p in parts])), np.concatenate([p[0] for p in parts])


def centred(layout: Layout, points: np.ndarray) -> np.ndarray:
    nodes = np.zeros((layout.node_count, 3))
    nodes[layout.nodes] = points[layout.marks]
    return points - nodes.mean(axis=0)


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_positions_converge_in_the_fourth_order(name: str) -> None:
    errors = []
    for step in (0.02, 0.01):
        samples, truth = exact_samples(name, step)
        points = solve_positions(samples.layout, edge_vectors(samples.layout, samples.frames)).points
        errors.append(np.linalg.norm(points - centred(samples.layout, truth), axis=1).mean())
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_rows_of_one_node_are_one_point() -> None:
    samples, _ = exact_samples("leaf", 0.02)
    noisy = samples.frames @ exp(0.1 * np.random.default_rng(0).standard_normal((samples.layout.size, 3)))
    layout = samples.layout
    points = solve_positions(layout, edge_vectors(layout, noisy)).points
    for node in range(layout.node_count):
        assert np.ptp(points[layout.marks[layout.nodes == node]], axis=0).max() == 0


def unknowns(layout: Layout) -> np.ndarray:
    """Number of the point at each row, nodes first."""
    point = np.full(layout.size, -1)
    point[layout.marks] = layout.nodes
    point[point < 0] = layout.node_count + np.arange((point < 0).sum())
    return point


@pytest.mark.parametrize("name", ["leaf", "egg"])
def test_positions_minimise_the_sum_over_edges(name: str) -> None:
    """Against one dense least-squares problem in all points at once."""
    samples, _ = exact_samples(name, 0.05)
    layout = samples.layout
    noisy = samples.frames @ exp(0.1 * np.random.default_rng(1).standard_normal((layout.size, 3)))
    edges, point = edge_vectors(layout, noisy), unknowns(layout)
    rows = np.zeros((len(edges), point.max() + 1))
    for i, row in enumerate(layout.edges):
        rows[i, point[row + 1]] += 1
        rows[i, point[row]] -= 1
    weight = 1 / np.sqrt(layout.lengths)[:, None]
    dense = np.linalg.lstsq(weight * rows, weight * edges, rcond=None)[0]
    expected = dense[point] - dense[: layout.node_count].mean(axis=0)
    np.testing.assert_allclose(solve_positions(layout, edges).points, expected, atol=1e-9)


def thesis_positions(layout: Layout, frames: np.ndarray) -> np.ndarray:
    """Eq. 3.31-3.32 as printed: rows of the Poisson equation inside, the tangent at the ends of open curves."""
    point, rows, right = unknowns(layout), [], []

    def equation(terms: list[tuple[int, float]], value: np.ndarray) -> None:
        row = np.zeros(point.max() + 1)
        for k, factor in terms:
            row[point[k]] += factor
        rows.append(row)
        right.append(value)

    t = frames[:, :, 0]
    for c, closed in enumerate(layout.closed):
        first, last = layout.first[c], layout.first[c + 1] - 1
        h = (layout.arc[last] - layout.arc[first]) / (last - first)
        for k in range(first + (not closed), last):
            before = k - 1 if k > first else last - 1
            equation([(before, 1 / h**2), (k, -2 / h**2), (k + 1, 1 / h**2)], (t[k] - t[before]) / h)
        if not closed:
            equation([(first, -1 / h), (first + 1, 1 / h)], t[first])
            equation([(last - 1, -1 / h), (last, 1 / h)], t[last])
    solution = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0][point]
    return centred(layout, solution)


def test_the_thesis_rows_agree_to_first_order_and_edges_are_closer() -> None:
    errors = []
    for step in (0.04, 0.02):
        samples, truth = exact_samples("leaf", step)
        layout = samples.layout
        thesis = thesis_positions(layout, samples.frames)
        ours = solve_positions(layout, edge_vectors(layout, samples.frames)).points
        errors.append([np.linalg.norm(p - centred(layout, truth), axis=1).mean() for p in (thesis, ours)])
    (thesis_coarse, ours_coarse), (thesis_fine, ours_fine) = errors
    assert 0.7 < np.log2(thesis_coarse / thesis_fine) < 1.3
    assert ours_coarse < thesis_coarse / 20 and ours_fine < thesis_fine / 100


def test_gaps_are_shared_out_by_the_covariances_of_segments() -> None:
    """Against a dense weighted least-squares problem in the nodes."""
    samples, _ = exact_samples("leaf", 0.05)
    layout, random = samples.layout, np.random.default_rng(1)
    edges = edge_vectors(layout, samples.frames @ exp(0.1 * random.standard_normal((layout.size, 3))))
    root = random.standard_normal((len(layout.segments), 3, 3)) + 2 * np.eye(3)
    rows = np.zeros((len(root), 3, layout.node_count, 3))
    for k, (a, b) in enumerate(layout.segment_nodes):
        rows[k, :, b], rows[k, :, a] = np.linalg.inv(root[k]), -np.linalg.inv(root[k])
    wanted = np.linalg.solve(root, segment_vectors(layout, edges)[:, :, None])
    dense = np.linalg.lstsq(rows.reshape(wanted.size, -1), wanted.ravel(), rcond=None)[0].reshape(-1, 3)
    points = solve_positions(layout, edges, root @ np.swapaxes(root, 1, 2)).points
    np.testing.assert_allclose(points[layout.marks], (dense - dense.mean(axis=0))[layout.nodes], atol=1e-9)


@pytest.mark.parametrize("turns", [1, 2])
def test_a_circle_alone_closes_on_itself(turns: int) -> None:
    arc = np.linspace(0, 1, 41)
    frames = exp(2 * np.pi * turns * arc[:, None] * np.array([0.0, 0.0, 1.0]))
    layout = Layout(
        arc,
        np.array([0, 41]),
        np.array([True]),
        np.array([True]),
        np.array([0, 40]),
        np.array([0, 0]),
        np.array([False]),
    )
    points = solve_positions(layout, edge_vectors(layout, frames)).points
    np.testing.assert_array_equal(points[0], points[-1])
    radius = np.linalg.norm(points[:-1] - points[:-1].mean(axis=0), axis=1)
    np.testing.assert_allclose(radius, 1 / (2 * np.pi * turns), rtol=1e-3)


def test_a_straight_line_is_exact() -> None:
    layout = Layout(
        np.array([0.0, 0.2, 0.5]), np.array([0, 3]), np.array([False]), np.array([False]), np.array([0, 2]),
        np.array([0, 1]), np.array([True, True]),
    )  # fmt: skip
    frames = np.broadcast_to(exp(np.array([0.1, 0.7, 0.3])), (3, 3, 3))
    positions = solve_positions(layout, edge_vectors(layout, frames))
    np.testing.assert_allclose(positions.points[2] - positions.points[0], 0.5 * frames[0, :, 0], atol=1e-15)
    np.testing.assert_allclose(positions.gaps, 0, atol=1e-15)
    np.testing.assert_allclose(segment_vectors(layout, edge_vectors(layout, frames))[0], 0.5 * frames[0, :, 0])


def test_pieces_are_named() -> None:
    scan = exact_scan(SHAPES["egg"](), 0.02)
    far = [replace(c, node_ids=c.node_ids + 100) for c in exact_scan(SHAPES["egg"](), 0.02).curves[:2]]
    layout = uniform_layout([place_curve(c) for c in clean_curves(Scan(scan.curves + tuple(far)).curves)], 0.05)
    with pytest.raises(ScanError, match=r"2 pieces .*\(curve 1, curve 2, curve 3, curve 4\); \(curve 5, curve 6\)"):
        check_connected(layout, np.arange(6))
