"""rawnet: lenient where the format's author is, exact in what it keeps, and every fault named with line and curve."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.errors import InputError, ScanError
from tracemesh.formats.rawnet import read_rawnet, write_rawnet
from tracemesh.geometry.scan import CurveScan, Scan

SAMPLE = "0.{i} 1 0 0 0 0 1\n"


def text(head: str, samples: int = 3) -> str:
    return head + "".join(SAMPLE.format(i=i) for i in range(samples))


def same(a: Scan, b: Scan, tolerance: float = 0.0) -> None:
    assert len(a.curves) == len(b.curves)
    for one, two in zip(a.curves, b.curves, strict=True):
        for name in ("distance", "tangent", "normal"):
            np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=0, atol=tolerance)
        assert one.node_samples.tolist() == two.node_samples.tolist()
        assert one.node_ids.tolist() == two.node_ids.tolist()
        assert (one.boundary, one.closed) == (two.boundary, two.closed)


def test_reads_the_authors_own_file(shared_data: Path) -> None:
    scan = read_rawnet((shared_data / "lilium.rawnet").read_text())
    assert [len(c.distance) for c in scan.curves] == [187, 112, 108]
    assert [(c.boundary, c.closed) for c in scan.curves] == [(True, True), (False, False), (False, False)]
    assert scan.curves[0].node_samples.tolist() == [0, 45, 91, 138, 186]
    assert scan.curves[2].node_ids.tolist() == [0, 3, 1]
    assert scan.curves[0].tangent[1] == pytest.approx([-0.20614305, 0.97852120, -0.00114224], abs=0)


@pytest.mark.parametrize("name", ["lilium.rawnet", "scans/cone-noisy.rawnet", "scans/torus-exact.rawnet"])
def test_writing_and_reading_keeps_every_number_of_a_file(shared_data: Path, name: str) -> None:
    scan = read_rawnet((shared_data / name).read_text())
    same(scan, read_rawnet(write_rawnet(scan)))


unit = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


@settings(max_examples=40, deadline=None)
@given(st.data(), st.integers(2, 8), st.booleans())
def test_reading_undoes_writing(data: st.DataObject, count: int, boundary: bool) -> None:
    vectors = [[v / np.linalg.norm(v) for v in data.draw(st.lists(unit, min_size=count, max_size=count))] for _ in "tn"]
    distance = np.array(data.draw(st.lists(st.floats(-1e4, 1e4), min_size=count, max_size=count)))
    ids = np.array(data.draw(st.lists(st.integers(0, 99), min_size=2, max_size=2)))
    curve = CurveScan(distance, np.array(vectors[0]), np.array(vectors[1]), np.array([0, count - 1]), ids, boundary)
    same(Scan((curve,)), read_rawnet(write_rawnet(Scan((curve,)))), tolerance=0.5000001e-8)


def test_comments_and_blank_lines_are_ignored() -> None:
    plain = text("1\n0\n0\n2\n1 3\n5 7\n3\n")
    noisy = "\ufeff# file: x\n\n" + plain.replace("\n", " # said\n\n  # more\n")
    same(read_rawnet(plain), read_rawnet(noisy))


def test_samples_outside_the_nodes_of_an_open_curve_are_dropped() -> None:
    curve = read_rawnet(text("1\n0\n0\n2\n2 4\n5 7\n5\n", 5)).curves[0]
    assert curve.distance.tolist() == [0.1, 0.2, 0.3]
    assert curve.node_samples.tolist() == [0, 2]


def test_a_closed_curve_keeps_its_overlap() -> None:
    curve = read_rawnet(text("1\n1\n1\n2\n2 4\n5 5\n5\n", 5)).curves[0]
    assert len(curve.distance) == 5
    assert curve.node_samples.tolist() == [1, 3]


def test_fewer_than_two_nodes_mean_one_at_both_ends() -> None:
    one = read_rawnet(text("1\n1\n1\n1\n2\n4\n3\n")).curves[0]
    assert (one.node_samples.tolist(), one.node_ids.tolist()) == ([0, 2], [4, 4])
    none = read_rawnet(text("1\n1\n1\n0\n3\n")).curves[0]
    assert (none.node_samples.tolist(), none.node_ids.tolist()) == ([0, 2], [0, 0])


def test_unmarked_curves_of_a_larger_network_stay_unmarked() -> None:
    scan = read_rawnet(text("2\n1\n1\n0\n3\n") + text("0\n0\n0\n3\n"))
    assert [len(c.node_ids) for c in scan.curves] == [0, 0]


HEAD = "1\n1\n1\n2\n1 3\n0 0\n3\n"
FAULTS = {
    "": ("line 1", "number of curves", "ends"),
    "x\n": ("line 1", "number of curves", "'x'"),
    "-1\n": ("line 1", "at least 0", "'-1'"),
    "0\n2\na.rawcurve\nb.rawcurve.reversed\n": ("line 1", ".rawcurve"),
    text("1\n2\n1\n2\n1 3\n0 0\n3\n"): ("line 2", "curve 1", "from 0 to 1", "'2'"),
    text("1\n1\n1\n2\n1 2 3\n0 0\n3\n"): ("line 5", "local", "2 on this line", "got 3"),
    text("1\n1\n1\n2\n3 1\n0 0\n3\n"): ("line 5", "increase", "3 1"),
    text("1\n1\n1\n2\n1 4\n0 0\n3\n"): ("line 5", "out of range", "1 to 3"),
    text("1\n1\n1\n2\n0 3\n0 0\n3\n"): ("line 5", "at least 1", "'0'"),
    text("1\n1\n1\n2\n1 3\n0 -1\n3\n"): ("line 6", "global", "'-1'"),
    text("1\n1\n1\n2\n1 3\n0 1\n3\n"): ("line 6", "closed", "wanted node 0 last, got 1"),
    text("1\n1\n1\n0\n1\n", 1): ("line 5", "number of samples", "at least 2"),
    text(HEAD, 2): ("line 9", "curve 1", "wanted 3 samples", "after 2"),
    HEAD: ("line 7", "curve 1", "wanted 3 samples", "after 0"),
    text(HEAD, 4): ("line 11", "after the 1 curves", "0.3 1 0"),
    text(HEAD, 2) + "0.3 1 0 0": ("line 10", "sample 3 of 3", "got 4"),
    text(HEAD, 2) + "0.3 1 o 0 0 0 1": ("line 10", "curve 1", "sample 3 of 3", "'o'"),
    text(HEAD, 2) + "0.3 1 0_0 0 0 0 1": ("line 10", "finite number", "'0_0'"),
    text(HEAD, 2) + "0.3 1 nan 0 0 0 1": ("line 10", "finite", "'nan'"),
    text(HEAD, 2) + "0.3 1 1e999 0 0 0 1": ("line 10", "finite", "'1e999'"),
    text(HEAD, 2) + "0.3 1 0 0 0 0 0": ("line 10", "normal of length 1", "got one of length 0"),
    text(HEAD) .replace("1\n", "2\n", 1): ("line 10", "curve 2 of 2", "ends"),
}  # fmt: skip


@pytest.mark.parametrize("faulty", FAULTS, ids=lambda t: repr(t[:30]))
def test_every_fault_says_where_what_was_wanted_and_what_came(faulty: str) -> None:
    with pytest.raises(InputError) as caught:
        read_rawnet(faulty, "scan.rawnet")
    for words in ("scan.rawnet", *FAULTS[faulty]):
        assert words in str(caught.value)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_damaged_file_gives_a_scan_or_an_input_error(data: st.DataObject) -> None:
    whole = text("2\n1\n1\n2\n1 3\n0 0\n3\n") + text("0\n0\n2\n1 3\n0 0\n3\n")
    at = data.draw(st.integers(0, len(whole)))
    damage = data.draw(st.text(alphabet="0123456789-+.en# \nax\x00", max_size=3))
    damaged = whole[:at] + damage + whole[at + data.draw(st.integers(0, 5)) :]
    try:
        scan = read_rawnet(damaged)
    except InputError:
        return
    assert all(np.isfinite(c.tangent).all() and len(c.distance) >= 2 for c in scan.curves)


def test_a_single_mark_cannot_be_written() -> None:
    rows = np.tile([1.0, 0, 0], (2, 1))
    curve = CurveScan(np.arange(2.0), rows, rows[:, ::-1].copy(), np.array([1]), np.array([0]))
    with pytest.raises(ScanError, match="curve 1"):
        write_rawnet(Scan((curve,)))
