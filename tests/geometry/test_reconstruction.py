"""The curve half end to end: known truth, convergence, and scans that cannot be used."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from tracemesh.errors import Cancelled, ScanError
from tracemesh.formats.meshes import read_mesh
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.geometry.comparison.evaluation import evaluate
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.reconstruction import NetworkParameters, NetworkReconstruction, reconstruct_network
from tracemesh.geometry.rotations import darboux_frames, exp
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan

FIXED = NetworkParameters(step=0.012, stretch=0.0, bend=0.02, curve_bias="off")


def exact(name: str = "leaf", spacing: float = 0.004) -> Scan:
    return exact_scan(SHAPES[name](), spacing)


def with_curve(scan: Scan, index: int, **fields: object) -> Scan:
    curves = list(scan.curves)
    curves[index] = replace(curves[index], **fields)
    return Scan(tuple(curves))


# data with known truth


class Truth:
    """Dense points on the true curves of a scan."""

    def __init__(self, path: Path) -> None:
        data = json.loads(path.read_text())
        points = np.array(data["points"])
        parts = [points[s["points"]] for s in data["segments"]]
        dense = [CubicSpline(range(len(p)), p)(np.arange(0, len(p) - 0.95, 0.05)) for p in parts]
        self.points = np.concatenate(dense)
        self.diagonal = np.linalg.norm(np.ptp(points, axis=0))

    def errors(self, points: np.ndarray) -> np.ndarray:
        """Distances (n,) in % of the diagonal after rigid alignment, both being oriented alike to start with."""
        tree, x = cKDTree(self.points), points - points.mean(axis=0) + self.points.mean(axis=0)
        for _ in range(40):
            y = self.points[tree.query(x)[1]]
            a, b = x - x.mean(axis=0), y - y.mean(axis=0)
            u, _, vt = np.linalg.svd(a.T @ b)
            x = a @ u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt + y.mean(axis=0)
        return 100 * tree.query(x)[0] / self.diagonal


@pytest.mark.parametrize(
    ("name", "mean"),
    [("sphere", 0.05), ("torus", 0.05), ("cone", 0.04), ("bumpy", 0.07), ("lilium", 0.06), ("lilium7", 0.06)],
)
def test_noisy_scans_with_all_defaults(shared_data: Path, name: str, mean: float) -> None:
    scan = read_rawnet((shared_data / f"scans/{name}-noisy.rawnet").read_text())
    truth = Truth(shared_data / f"scans/{name}.truth.network.json")
    assert truth.errors(reconstruct_network(scan).network.points).mean() < mean


@pytest.mark.parametrize("name", ["cone", "lilium", "sphere", "torus", "bumpy", "lilium7"])
def test_exact_scans(shared_data: Path, name: str) -> None:
    scan = read_rawnet((shared_data / f"scans/{name}-exact.rawnet").read_text())
    truth = Truth(shared_data / f"scans/{name}.truth.network.json")
    coarse, fine = (NetworkParameters(step=share * truth.diagonal) for share in (0.016, 0.004))
    assert truth.errors(reconstruct_network(scan, coarse).network.points).mean() < 0.03
    assert truth.errors(reconstruct_network(scan, fine).network.points).mean() < 0.003


def test_the_authors_polyline_is_reproduced_to_rounding(shared_data: Path) -> None:
    result = reconstruct_network(read_rawnet((shared_data / "lilium.rawnet").read_text()))
    vertices, faces = read_mesh((shared_data / "lilium.obj").read_bytes(), "obj")
    found = evaluate(result.network.points, None, vertices, faces, align="rigid")
    assert "chords" in result.report["parameters"]["tangents"]  # type: ignore[index]
    assert found.mean < 0.002 and found.max < 0.01


# convergence


@pytest.mark.parametrize("name", ["leaf", "torus", "egg"])
def test_exact_scans_converge_in_the_second_order_at_least(true_points: Callable, misfit: Callable, name: str) -> None:
    curves, errors = SHAPES[name]().curves, []
    for step in (0.04, 0.02):
        network = reconstruct_network(exact(name, 0.002), NetworkParameters(step=step)).network
        errors.append(misfit(network.points, true_points(network, curves)).mean())
    assert np.log2(errors[0] / errors[1]) > 1.9


# the network


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_every_point_is_there_once_and_segments_run_from_node_to_node(name: str) -> None:
    network = reconstruct_network(exact(name)).network
    used = np.bincount(np.concatenate([s.points[1:-1] for s in network.segments]), minlength=len(network.points))
    assert (used[np.setdiff1d(np.arange(len(used)), network.nodes)] == 1).all()
    assert (used[network.nodes] == 0).all()
    ends = {int(p) for s in network.segments for p in (s.points[0], s.points[-1])}
    assert ends == set(network.nodes.tolist())
    np.testing.assert_allclose(np.linalg.norm(network.normals, axis=1), 1, atol=1e-12)
    edges = [np.linalg.norm(np.diff(network.points[s.points], axis=0), axis=1) for s in network.segments]
    assert np.concatenate(edges).min() > 0.3 * np.median(np.concatenate(edges))


def test_one_closed_curve_alone_has_no_node() -> None:
    arc = np.linspace(0, 1, 200)
    frames = exp(2 * np.pi * arc[:, None] * np.array([0.0, 0.0, 1.0]))
    network = reconstruct_network(Scan((CurveScan(arc, frames[:, :, 0], -frames[:, :, 1], closed=True),))).network
    assert len(network.nodes) == 0
    assert network.segments[0].points[0] == network.segments[0].points[-1]
    radius = np.linalg.norm(network.points - network.points.mean(axis=0), axis=1)
    np.testing.assert_allclose(radius, 1 / (2 * np.pi), rtol=1e-4)


def test_a_scan_under_way_is_a_network_with_a_loose_end() -> None:
    scan = exact()
    curve = scan.curves[1]
    end = int(curve.node_samples[1]) - 20
    begun = CurveScan(
        curve.distance[:end], curve.tangent[:end], curve.normal[:end], curve.node_samples[:1], curve.node_ids[:1]
    )
    network = reconstruct_network(Scan((scan.curves[0], begun))).network
    assert len(network.nodes) == len(scan.curves[0].node_ids)  # one of the closed curve's repeats, one is the loose end
    assert [s.curve for s in network.segments].count(1) == 1


# re-solving, progress, thesis weights


def test_solving_again_with_other_weights_is_solving_anew(faulty_scan: Callable) -> None:
    scan = faulty_scan("leaf", 0.003, seed=7, noise=0.02, heading=0.02, mark=0.001).scan
    kept = NetworkReconstruction(scan, NetworkParameters(step=0.012))
    kept.solve()
    again = kept.solve(Weights(0.01, 0.05)).network
    anew = reconstruct_network(scan, NetworkParameters(step=0.012, stretch=0.01, bend=0.05)).network
    np.testing.assert_allclose(again.points, anew.points, rtol=0, atol=1e-8 * anew.diagonal)


def test_progress_rises_and_may_cancel() -> None:
    told: list[tuple[str, float]] = []
    reconstruct_network(exact(), progress=lambda stage, share: told.append((stage, share)))
    assert len(told) >= 6 and told[0][1] == 0
    assert all(a[1] < b[1] < 1 for a, b in pairwise(told))

    def cancel(stage: str, share: float) -> None:
        if share > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        reconstruct_network(exact(), progress=cancel)


def test_the_report_is_json_and_says_what_was_done(faulty_scan: Callable) -> None:
    result = reconstruct_network(faulty_scan("leaf", seed=3, noise=0.02, heading=0.02).scan)
    report = json.loads(json.dumps(result.report))
    assert report["sizes"]["points"] == len(result.network.points) == len(result.frames)
    assert report["parameters"]["bend_m"] > 0
    assert report["curve_bias"]["on"]
    assert report["frame_noise_deg"] == pytest.approx(np.degrees(0.02), rel=0.1)
    assert set(report["seconds"]) >= {"measuring", "weighing", "closing", "smoothing", "positions"}


def test_robust_loss_bears_scans_of_which_much_is_chance() -> None:
    scan, random = exact(), np.random.default_rng(3)
    curves = []
    for c in scan.curves:
        count = len(c.distance)
        spoiled = random.random(count) < 0.08
        size = np.where(spoiled[:, None], np.pi, np.radians(1.4))
        frames = darboux_frames(c.tangent, c.normal) @ exp(size * random.uniform(-1, 1, (count, 3)))
        curves.append(replace(c, tangent=frames[:, :, 0], normal=frames[:, :, 1]))
    truth = reconstruct_network(scan, NetworkParameters(step=0.02)).network
    errors = []
    for robust in (False, True):
        network = reconstruct_network(Scan(tuple(curves)), NetworkParameters(step=0.02, robust=robust)).network
        errors.append(np.sqrt(np.mean((network.normals - truth.normals) ** 2)))
    assert errors[1] < errors[0] / 2


def test_thesis_weights_are_lambda_and_mu_of_one() -> None:
    thesis = reconstruct_network(exact(), NetworkParameters(weights="thesis", curve_bias="off"))
    given_ones = reconstruct_network(exact(), NetworkParameters(stretch=1.0, bend=1.0, curve_bias="off"))
    np.testing.assert_array_equal(thesis.network.points, given_ones.network.points)


# scans that cannot be used


def test_two_pieces_are_named() -> None:
    far = tuple(replace(c, node_ids=c.node_ids + 50) for c in exact("egg").curves)
    with pytest.raises(ScanError, match=r"2 pieces.*curve 1, curve 2.*curve 6"):
        reconstruct_network(Scan(exact().curves + far))


def test_a_closed_curve_that_is_not_is_named() -> None:
    arc = np.linspace(0, 1, 100)
    frames = exp(np.pi * arc[:, None] * np.array([0.0, 0.0, 1.0]))
    half = CurveScan(arc, frames[:, :, 0], frames[:, :, 1], closed=True)
    with pytest.raises(ScanError, match=r"curve 1 is marked as closed, but ends 0\.637 m from where it began \(64 %"):
        reconstruct_network(Scan((half,)))


def test_the_automatic_prefilter_is_reported_and_given_explicitly_it_changes_nothing() -> None:
    automatic = reconstruct_network(exact(), FIXED)
    used = automatic.report["parameters"]["prefilter_m"]  # type: ignore[index]
    assert used == FIXED.step / 2  # type: ignore[operator]
    given = reconstruct_network(exact(), replace(FIXED, prefilter=used))
    np.testing.assert_array_equal(given.network.points, automatic.network.points)
    other = reconstruct_network(exact(), replace(FIXED, prefilter=2 * used))
    assert not np.array_equal(other.network.points, automatic.network.points)


def test_an_empty_scan_and_senseless_parameters_are_refused() -> None:
    with pytest.raises(ScanError, match="no curve"):
        reconstruct_network(Scan(()))
    for wrong in ({"step": 0.0}, {"step": np.nan}, {"step_fraction": -1.0}, {"bend": -0.1}, {"prefilter": 0.0}):
        with pytest.raises(ScanError, match=next(iter(wrong))):
            reconstruct_network(exact(), NetworkParameters(**wrong))
    with pytest.raises(ScanError, match=r"pre-filter of at most 25 steps, 0\.25 m, got 0\.3 m"):
        reconstruct_network(exact(), NetworkParameters(step=0.01, prefilter=0.3))
    with pytest.raises(ScanError, match="more than 5000000 samples"):
        reconstruct_network(exact(), NetworkParameters(step=1e-9))


def test_lengths_of_vectors_do_not_matter() -> None:
    scan, random, curves = exact(), np.random.default_rng(0), []
    for curve in scan.curves:
        along, up = random.uniform(1e-6, 1e6, (2, len(curve.distance), 1))
        curves.append(replace(curve, tangent=along * curve.tangent, normal=up * curve.normal))
    one, other = (reconstruct_network(s, FIXED).network.points for s in (scan, Scan(tuple(curves))))
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-9)


def test_a_node_on_one_curve_only_is_a_node() -> None:
    scan = exact()
    curve = scan.curves[1]
    middle = (curve.node_samples[0] + curve.node_samples[1]) // 2
    samples, nodes = np.insert(curve.node_samples, 1, middle), np.insert(curve.node_ids, 1, 999)
    lonely = with_curve(scan, 1, node_samples=samples, node_ids=nodes)
    one, other = (reconstruct_network(s, FIXED).network for s in (scan, lonely))
    assert (len(other.nodes), len(other.segments)) == (len(one.nodes) + 1, len(one.segments) + 1)


def looped(count: int, turns: float, node_samples: Sequence[int] = (), node_ids: Sequence[int] = ()) -> Scan:
    """A flat curve that turns to and fro by so many turns either way: with more than a half it crosses itself."""
    arc = np.linspace(0, 1, count)
    angle = turns * np.sin(2 * np.pi * arc) * 2 * np.pi
    tangent = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    normal = np.tile([0.0, 0.0, 1.0], (count, 1))
    return Scan((CurveScan(arc, tangent, normal, np.array(node_samples, int), np.array(node_ids, int)),))


@pytest.mark.parametrize("turns", [0.4, 1.3])
def test_a_curve_may_cross_itself_with_or_without_a_node_there(turns: float) -> None:
    network = reconstruct_network(looped(2000, turns)).network
    assert len(network.nodes) == 2
    again = reconstruct_network(looped(2000, turns, (0, 400, 1500, 1999), (0, 1, 1, 2))).network
    assert len(again.nodes) == 3
    assert np.isfinite(again.points).all()


def test_a_million_samples() -> None:
    network = reconstruct_network(looped(1_000_000, 0.4), NetworkParameters(step=0.004)).network
    assert len(network.points) == 251
    few = reconstruct_network(looped(20_000, 0.4), NetworkParameters(step=0.004)).network
    np.testing.assert_allclose(network.points, few.points, atol=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_any_small_scan_gives_a_finite_network_or_a_clear_error(data: st.DataObject) -> None:
    random = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    curves = []
    for _ in range(data.draw(st.integers(1, 3))):
        n = data.draw(st.integers(0, 12))
        marks = (
            np.sort(random.choice(n, min(n, data.draw(st.integers(0, 4))), replace=data.draw(st.booleans())))
            if n
            else []
        )
        steps = random.choice([0.0, 1e-9, 0.01, 0.02, -0.01], n, p=[0.1, 0.05, 0.4, 0.4, 0.05])
        vectors = random.standard_normal((2, n, 3)) * data.draw(st.sampled_from([1.0, 1e-3]))
        if n and data.draw(st.integers(0, 9)) == 0:
            vectors[0, 0, 0] = data.draw(st.sampled_from([np.nan, np.inf, 0.0]))
        ids = random.integers(0, 4, len(marks))
        closed = data.draw(st.booleans())
        curves.append(CurveScan(np.cumsum(steps), *vectors, np.array(marks, np.int64), ids, closed=closed))
    try:
        result = reconstruct_network(Scan(tuple(curves)))
    except ScanError as error:
        assert "curve" in str(error)
    else:
        assert np.isfinite(result.network.points).all() and np.isfinite(result.uncertainty).all()
