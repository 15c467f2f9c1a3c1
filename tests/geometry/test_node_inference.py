"""Nodes without marks: found on real-size noisy scans, on every built-in shape, and honest where two places fit."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracemesh.errors import ScanError
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import recording_from_simulation, scan_from_recordings
from tracemesh.geometry.curves.reconstruction import reconstruct_network
from tracemesh.geometry.nodes.attachment import _statistics, attach, table_of
from tracemesh.geometry.nodes.contacts import Contact, _System, settle
from tracemesh.geometry.nodes.crossings import find_crossings
from tracemesh.geometry.nodes.floating import FloatingCurve, Pose, float_curves
from tracemesh.geometry.nodes.node_inference import InferredNodes, infer_nodes, mark_nodes
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shapes import SHAPES, leaf
from tracemesh.geometry.simulated.simulation import exact_scan, plan_scan, simulate_scan

SCANS = ("sphere", "torus", "cone", "bumpy", "lilium", "lilium7")
NOTHING = np.empty(0, np.int64)
HERE = Pose(0.0, np.zeros(3))
Pair = tuple[int, float, int, float]


def unmarked(scan: Scan) -> Scan:
    return Scan(tuple(replace(c, node_samples=NOTHING, node_ids=NOTHING) for c in scan.curves))


def noisy_scan(folder: Path, name: str) -> Scan:
    return read_rawnet((folder / f"scans/{name}-noisy.rawnet").read_text())


def simulated_scan(name: str, seed: int) -> Scan:
    plan = plan_scan(SHAPES[name](), seed=seed)
    return scan_from_recordings([recording_from_simulation(simulate_scan(plan, seed), name)])


def pairs(nodes: Sequence[dict[int, float]]) -> list[Pair]:
    """Every two curves that meet in a node, with the odometer's reading (m) on each."""
    return [(i, node[i], j, node[j]) for node in nodes for i in node for j in node if i < j]


def true_pairs(scan: Scan) -> list[Pair]:
    nodes: dict[int, dict[int, float]] = {}
    for i, curve in enumerate(scan.curves):
        for sample, node in zip(curve.node_samples, curve.node_ids, strict=True):
            nodes.setdefault(int(node), {}).setdefault(i, float(curve.distance[sample]))
    return pairs(list(nodes.values()))


def found_pairs(scan: Scan, found: InferredNodes) -> list[Pair]:
    return pairs([{i: float(scan.curves[i].distance[k]) for i, k in p.places} for p in found.proposals])


def way(curve: CurveScan, a: float, b: float) -> float:
    length = float(np.ptp(curve.distance))
    return abs((a - b + length / 2) % length - length / 2) if curve.closed else abs(a - b)


def matches(scan: Scan, found: InferredNodes, tolerance: float) -> Iterator[tuple[float, int]]:
    """For each true pair that was found: how far off (m, on the worse of the two curves), and by which proposal."""
    proposed = found_pairs(scan, found)
    for i, at_i, j, at_j in true_pairs(scan):
        errors = [
            (max(way(scan.curves[i], at_i, p[1]), way(scan.curves[j], at_j, p[3])), k)
            for k, p in enumerate(proposed)
            if (p[0], p[2]) == (i, j)
        ]
        if errors and min(errors)[0] <= tolerance:
            yield min(errors)


def test_all_nodes_of_the_noisy_scans_are_found_and_no_others(shared_data: Path) -> None:
    wanted = proposed = 0
    errors: list[float] = []
    used = 0
    for name in SCANS:
        scan = noisy_scan(shared_data, name)
        found = infer_nodes(unmarked(scan))
        hits = list(matches(scan, found, 0.02))
        wanted, proposed = wanted + len(true_pairs(scan)), proposed + len(found_pairs(scan, found))
        used, errors = used + len({k for _, k in hits}), errors + [e for e, _ in hits]
        assert found.unplaced == ()
    assert len(errors) / wanted >= 0.98
    assert used / proposed >= 0.98
    assert np.median(errors) <= 0.004


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_built_in_shapes_even_one_without_boundary(name: str) -> None:
    scan = simulated_scan(name, seed=5)
    found = infer_nodes(unmarked(scan))
    hits = list(matches(scan, found, 0.025))
    assert len(hits) == len(true_pairs(scan)) == len(found_pairs(scan, found))
    assert all(p.confidence > 0.6 for p in found.proposals)


def test_places_that_the_shape_hardly_determines_are_less_sure() -> None:
    """A ring on a cone can slide along the rulings, on which normals do not change; on a leaf nothing can slide."""
    cone, surface = (infer_nodes(unmarked(simulated_scan(name, seed=1))).proposals for name in ("cone", "leaf"))
    on_ring = [p.confidence for p in cone if any(curve == 1 for curve, _ in p.places)]
    assert max(on_ring) < 0.9 < min(p.confidence for p in surface)
    held = [p.confidence for p in cone if any(curve == 0 for curve, _ in p.places)]
    assert min(held) > 0.95


def test_a_scan_without_marks_reconstructs_nearly_as_well(shared_data: Path) -> None:
    scan = noisy_scan(shared_data, "lilium")
    marked = reconstruct_network(scan).network
    found = reconstruct_network(mark_nodes(unmarked(scan), infer_nodes(unmarked(scan)).proposals)).network
    assert (len(found.nodes), len(found.segments)) == (len(marked.nodes), len(marked.segments))
    nearest = np.linalg.norm(found.points[:, None] - marked.points, axis=2).min(axis=1)
    assert nearest.mean() < 0.01 * marked.diagonal


def test_marked_nodes_keep_their_numbers_and_hold_curves_together() -> None:
    scan = simulated_scan("leaf", seed=7)
    boundary = replace(scan.curves[0], closed=False)
    partly = Scan((boundary, scan.curves[1], *unmarked(Scan(scan.curves[2:])).curves))
    found = infer_nodes(partly)
    assert found.unplaced == ()
    assert len(list(matches(scan, found, 0.025))) == len(true_pairs(scan))
    numbered = {p.node for p in found.proposals if p.node is not None}
    assert numbered == {*scan.curves[0].node_ids.tolist(), *scan.curves[1].node_ids.tolist()}
    again = mark_nodes(partly, found.proposals)
    assert again.curves[0].node_ids.tolist() == boundary.node_ids.tolist()
    assert {0, 6} <= set(again.curves[1].node_ids.tolist())


def test_nothing_that_was_marked_is_lost_or_merged(shared_data: Path) -> None:
    """Three nodes of this scan lie within 5 mm; found ones would be one, marked ones stay three."""
    scan = noisy_scan(shared_data, "lilium7")
    again = mark_nodes(scan, infer_nodes(scan).proposals)
    for one, two in zip(scan.curves, again.curves, strict=True):
        assert two.node_ids.tolist() == one.node_ids.tolist()
        assert np.abs(one.distance[one.node_samples] - two.distance[two.node_samples]).max() < 0.004


def test_a_mark_on_one_curve_only_gives_the_node_its_number_and_place() -> None:
    scan = unmarked(simulated_scan("leaf", seed=7))
    true = simulated_scan("leaf", seed=7).curves[4]
    inside, sample = int(true.node_ids[1]), int(true.node_samples[1])
    lonely = replace(scan.curves[4], node_samples=np.array([sample]), node_ids=np.array([inside]))
    found = infer_nodes(Scan((*scan.curves[:4], lonely)))
    (numbered,) = [p for p in found.proposals if p.node is not None]
    assert numbered.node == inside
    place = dict(numbered.places)[4]
    assert abs(true.distance[place] - true.distance[sample]) < 0.002
    assert len(numbered.places) == 2


def test_without_anything_to_begin_with_it_says_so() -> None:
    scan = unmarked(Scan(tuple(replace(c, closed=False) for c in exact_scan(leaf(), 0.01).curves)))
    with pytest.raises(ScanError, match="the scan has neither"):
        infer_nodes(scan)


def test_a_curve_that_touches_nothing_is_named_not_guessed() -> None:
    scan = exact_scan(leaf(), 0.01)
    upside_down = Rotation.from_rotvec([np.pi, 0, 0])
    strange = replace(
        scan.curves[1],
        tangent=upside_down.apply(scan.curves[1].tangent),
        normal=upside_down.apply(scan.curves[1].normal),
    )
    found = infer_nodes(unmarked(Scan((*scan.curves, strange))))
    assert found.unplaced == (len(scan.curves),)


def flat(points: np.ndarray, closed: bool) -> CurveScan:
    """A scan of a polyline in the plane z = 0."""
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    tangent = np.gradient(points, np.concatenate([[0], np.cumsum(length)]), axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.broadcast_to([0.0, 0.0, 1.0], tangent.shape).copy()
    return CurveScan(np.concatenate([[0], np.cumsum(length)]), tangent, normal, boundary=closed, closed=closed)


def test_two_places_that_fit_alike_halve_the_confidence() -> None:
    """A flat disk: the same chord fits on both sides of the centre."""
    angle = np.linspace(0, 2 * np.pi, 801)
    rim = 0.5 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    x = np.linspace(-0.4, 0.4, 201)
    chord = np.column_stack([x, np.full_like(x, 0.3), 0 * x])
    found = infer_nodes(Scan((flat(rim, True), flat(chord, False))))
    assert len(found.proposals) == 2
    assert all(0.4 < p.confidence < 0.6 for p in found.proposals)


def test_attaching_finds_the_same_minimum_as_trying_pair_by_pair() -> None:
    curves = float_curves(unmarked(exact_scan(leaf(), 0.02)))
    coarse = [_thinned(c, 12) for c in curves[:2]]
    places = table_of(coarse, {0: HERE})
    whitening, wanted, _ = _statistics(coarse[1])
    costs = {
        (i, j): float(np.sum((whitening @ (np.concatenate([q - p, n, m]) - wanted)) ** 2))
        for i, (p, n) in enumerate(zip(places.points, places.normals, strict=True))
        for j, (q, m) in enumerate(zip(places.points, places.normals, strict=True))
    }
    found = attach(coarse[1], places)
    assert found is not None
    assert (found.first, found.last) == min(costs, key=lambda k: costs[k])


def _thinned(curve: FloatingCurve, stride: int) -> FloatingCurve:
    rows = np.unique([*range(0, len(curve.arc), stride), len(curve.arc) - 1])
    return replace(curve, arc=curve.arc[rows], points=curve.points[rows], normals=curve.normals[rows])


def exact_contacts(scan: Scan, curves: Sequence[FloatingCurve], off: float) -> list[Contact]:
    return [
        Contact(i, at_i - curves[i].start + off, j, at_j - curves[j].start - off, 1.0)
        for i, at_i, j, at_j in true_pairs(scan)
        if not (curves[i].closed and curves[j].closed)
    ]


def test_settling_brings_exact_curves_exactly_together() -> None:
    scan = exact_scan(leaf(), 0.005)
    curves = float_curves(scan)
    true = {i: curve.at(np.array([0.0]))[0][0] - curves[i].points[0] for i, curve in enumerate(leaf().curves)}
    poses = {i: Pose(0.01 * (i > 0), shift - true[0] + 0.01 * (i > 0)) for i, shift in true.items()}
    settled = settle(curves, poses, exact_contacts(scan, curves, 0.004))
    assert settled.misfit.max() < 1e-3
    for i, shift in true.items():
        np.testing.assert_allclose(settled.poses[i].shift, shift - true[0], atol=3e-4)
        assert abs(settled.poses[i].turn) < 1e-3
    for contact, exact in zip(settled.contacts, exact_contacts(scan, curves, 0.0), strict=True):
        assert curves[contact.a].apart(contact.s, exact.s) == pytest.approx(0, abs=5e-4)


def test_the_joint_solution_uses_true_derivatives() -> None:
    scan = exact_scan(leaf(), 0.02)
    curves = float_curves(scan)
    contacts = exact_contacts(scan, curves, 0.003)
    placed = list(range(len(curves)))
    system = _System(curves, placed, contacts, np.zeros(3))
    places = [x for c in contacts for x in (c.s + 0.01, c.t + 0.01)]
    unknowns = np.concatenate([np.random.default_rng(0).normal(0, 0.05, 4 * len(placed)), places])
    jacobian = system.linearised(unknowns)[1]
    step = 1e-6
    for k in range(len(unknowns)):
        aside = step * (np.arange(len(unknowns)) == k)
        slope = (system.linearised(unknowns + aside)[0] - system.linearised(unknowns - aside)[0]) / (2 * step)
        np.testing.assert_allclose(jacobian[:, k], slope, atol=2e-5 * max(1.0, float(np.abs(slope).max())))


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_exact_curves_cross_exactly_in_their_nodes(name: str) -> None:
    scan = exact_scan(SHAPES[name](), 0.005)
    curves = float_curves(scan)
    true = [c.at(np.array([0.0]))[0][0] for c in SHAPES[name]().curves]
    poses = [Pose(0.0, start - c.points[0]) for start, c in zip(true, curves, strict=True)]
    for i, at_i, j, at_j in true_pairs(scan):
        found = find_crossings(curves[i], poses[i], curves[j], poses[j])
        ends = (0.0, curves[j].length)
        inside = all(abs(at_j - end) > 0.01 for end in ends)
        near = [c for c in found if abs(curves[i].apart(c.s, at_i)) < 0.005 and abs(curves[j].apart(c.t, at_j)) < 0.005]
        assert near or not inside
        assert all(c.distance < 1e-3 and c.tilt < 0.05 for c in near)
