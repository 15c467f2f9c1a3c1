"""Lengths of single segments that somebody measured with a tape."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.curves.sketch import give_lengths
from tracemesh.geometry.scan import CurveScan, Floats, Scan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan

PARAMETERS = NetworkParameters(step=0.02, stretch=0.01, bend=0.02, curve_bias="off")


@pytest.fixture(scope="module")
def measured() -> Scan:
    """An exact scan of a torus."""
    return exact_scan(SHAPES["torus"](), 0.004)


def segment_lengths(curve: CurveScan) -> Floats:
    return np.diff(curve.distance[curve.node_samples])


def timed(scan: Scan, seed: int) -> Scan:
    """Its curves drawn by hand, each segment at a speed of its own."""
    return Scan(tuple(at_other_speeds(c, np.random.default_rng([seed, i])) for i, c in enumerate(scan.curves)))


def at_other_speeds(curve: CurveScan, random: np.random.Generator) -> CurveScan:
    marks = curve.distance[curve.node_samples]
    stretched = np.cumsum([0.0, *random.uniform(0.5, 2.0, len(marks) - 1) * np.diff(marks)])
    return replace(curve, distance=np.interp(curve.distance, marks, stretched), timed=True)


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 1000))
def test_with_all_lengths_given_speeds_do_not_matter(measured: Scan, seed: int) -> None:
    lengths = {(i, k): m for i, c in enumerate(measured.curves) for k, m in enumerate(segment_lengths(c).tolist())}
    sketched = reconstruct_network(give_lengths(timed(measured, seed), lengths), PARAMETERS).network
    np.testing.assert_allclose(sketched.points, reconstruct_network(measured, PARAMETERS).network.points, atol=1e-9)


def test_one_length_gives_the_whole_its_scale(measured: Scan) -> None:
    true = reconstruct_network(measured, PARAMETERS).network.diagonal
    plain = Scan(tuple(replace(c, distance=3.0 * c.distance, timed=True) for c in measured.curves))
    assert reconstruct_network(plain, PARAMETERS).network.diagonal == pytest.approx(3.0 * true, rel=0.02)
    one = give_lengths(plain, {(1, 0): float(segment_lengths(measured.curves[1])[0])})
    assert reconstruct_network(one, PARAMETERS).network.diagonal == pytest.approx(true, rel=0.02)


def test_a_given_length_corrects_a_wheel_too(measured: Scan) -> None:
    true = float(segment_lengths(measured.curves[0])[0])
    marks = measured.curves[0].distance[measured.curves[0].node_samples]
    slipped = np.where(measured.curves[0].distance > marks[0], measured.curves[0].distance - 0.1 * true, marks[0])
    distance = np.where(
        measured.curves[0].distance < marks[1],
        marks[0] + 0.9 * (measured.curves[0].distance - marks[0]),
        slipped,
    )
    faulty = Scan((replace(measured.curves[0], distance=distance), *measured.curves[1:]))
    mended = reconstruct_network(give_lengths(faulty, {(0, 0): true}), PARAMETERS).network
    np.testing.assert_allclose(mended.points, reconstruct_network(measured, PARAMETERS).network.points, atol=1e-9)


@pytest.mark.parametrize(("place", "kept"), [(0.0, (1,)), (0.3, (0, 1)), (1.0, (0,))], ids=["begin", "middle", "end"])
def test_the_only_node_of_an_open_curve_parts_it_in_two(measured: Scan, place: float, kept: tuple[int, ...]) -> None:
    """A branch that hangs on one node: what lies before it and after it has a length of its own."""
    first = measured.curves[0]
    sample = round(place * (len(first.distance) - 1))
    branch = replace(first, node_samples=np.array([sample]), node_ids=first.node_ids[:1], closed=False)
    scan = Scan((branch, *measured.curves[1:]))
    given = give_lengths(scan, {(0, k): (0.2, 0.5)[k] for k in kept})
    network = reconstruct_network(given, PARAMETERS).network
    own = [s for s in network.segments if s.curve == 0]
    along = [float(np.linalg.norm(np.diff(network.points[s.points], axis=0), axis=1).sum()) for s in own]
    assert along == pytest.approx([(0.2, 0.5)[k] for k in kept], rel=0.02)
    for missing in {0, 1} - set(kept):
        words = f"{('before', 'after')[missing]} the only node of curve 1, but that is less than 2 % of the curve"
        with pytest.raises(ScanError, match=words):
            reconstruct_network(give_lengths(scan, {(0, missing): 0.1}), PARAMETERS)


@pytest.mark.parametrize(
    ("place", "length", "words"),
    [
        ((99, 0), 1.0, "curve 100, but there are"),
        ((0, 99), 1.0, "segment 100 of curve 1, which has"),
        ((0, 0), 0.0, "positive length for segment 1 of curve 1, got 0"),
        ((0, 0), float("nan"), "positive"),
    ],
)
def test_what_cannot_be_a_length_is_refused(measured: Scan, place: tuple[int, int], length: float, words: str) -> None:
    with pytest.raises(ScanError, match=words):
        give_lengths(measured, {place: length})


def test_lengths_of_other_segments_than_there_are_name_the_curve(measured: Scan) -> None:
    wrong = replace(measured.curves[1], lengths=np.array([1.0] * 77))
    with pytest.raises(ScanError, match=r"curve 2 has .* segments, but lengths are given for 77"):
        reconstruct_network(Scan((measured.curves[0], wrong, *measured.curves[2:])))
