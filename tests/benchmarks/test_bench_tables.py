"""Every table of the benchmarks runs on its smallest size, and what is written can be read."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import accuracy, arrays, crossings, growth, lengths, meshes, nodes, noisy, regression, surfacing, times
from benchmarks.__main__ import main
from benchmarks.data import ROOT, Data, noisy_scan
from benchmarks.report import elsewhere, read_report, record, write_report
from benchmarks.table import Column, Table
from benchmarks.thesis_energy import ThesisEnergy
from tracemesh.geometry.curves.energy import EnergyPoint
from tracemesh.geometry.curves.stencil import Stencil
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan

WITHOUT = Data(None)


def numbers(table: Table, column: int) -> list[float]:
    return [float(row[column]) for row in table.rows if isinstance(row[column], int | float)]


def test_table_renders_aligned_with_absent_figures_and_joined_notes() -> None:
    table = Table("t", "A title", (Column("a"), Column("b, m", ".2f")), (("x", 1.234), ("yy", None)), ("one\n   two",))
    assert table.markdown().splitlines() == [
        "## A title",
        "",
        "| a  | b, m |",
        "| -- | ---: |",
        "| x  | 1.23 |",
        "| yy |    – |",
        "",
        "one two",
    ]
    assert table.document()["rows"] == [["x", 1.234], ["yy", None]]
    assert Table.read(json.loads(json.dumps(table.document()))).markdown() == table.markdown()


def test_row_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="wanted 1 cells a row, got 2"):
        Table("t", "", (Column("a"),), (("x", 1),))


def test_report_keeps_other_tables_of_the_same_machine_only(tmp_path: Path) -> None:
    table = Table("one", "First", (Column("a"),), (("x",),))
    machine: dict[str, object] = {"processor": "p", "packages": {"numpy": "2"}}
    report = read_report(tmp_path / "benchmarks.json", machine)
    report["tables"]["one"] = record(table, "2026-01-01", "abc", 1.0, 0.0404)
    write_report(tmp_path, report, ["two", "one"])
    assert "## First" in (tmp_path / "benchmarks.md").read_text()
    assert "in 1 s; yardstick 40 ms." in (tmp_path / "benchmarks.md").read_text()
    assert json.loads((tmp_path / "benchmarks.json").read_text())["tables"]["one"]["table"]["rows"] == [["x"]]
    assert list(read_report(tmp_path / "benchmarks.json", machine)["tables"]) == ["one"]
    assert read_report(tmp_path / "benchmarks.json", {**machine, "processor": "q"})["tables"] == {}
    assert elsewhere(tmp_path / "benchmarks.json", machine) == ""
    assert elsewhere(tmp_path / "none.json", machine) == ""
    other: dict[str, object] = {"processor": "p", "packages": {"numpy": "3"}}
    assert elsewhere(tmp_path / "benchmarks.json", other) == "numpy 2 there, 3 here"


def test_tables_of_another_machine_are_not_dropped_unasked(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "77")
    before = (ROOT / "docs" / "benchmarks.json").read_bytes()
    with pytest.raises(SystemExit):
        main(["regression"])
    assert "blas_threads 1 there, 77 here" in capsys.readouterr().err
    assert (ROOT / "docs" / "benchmarks.json").read_bytes() == before


def test_surfacing(shared_data: Path) -> None:
    table = surfacing.surfacing(Data(shared_data), ("field-4",))
    (row,) = table.rows
    biharmonic, _, thesis = row[1:4]
    assert biharmonic == pytest.approx(0.120, abs=0.005)  # published: .120 and .074
    assert thesis == pytest.approx(0.074, abs=0.01)
    assert row[0] == "field-4"
    assert surfacing.surfacing(WITHOUT).rows == ()


def test_steps_and_author(shared_data: Path) -> None:
    table = accuracy.steps(WITHOUT, ("leaf",), (6.4, 3.2, 1.6))
    coarse, middle, fine, order = (float(table.rows[0][k] or 0) for k in (1, 2, 3, 4))
    assert 3 * fine < middle < coarse / 3
    assert order == pytest.approx(np.log2(coarse / middle))
    assert numbers(accuracy.author(Data(shared_data), (6.4,)), 2)[0] < 0.002
    assert accuracy.author(WITHOUT).rows == ()


def test_weights_and_surfaces() -> None:
    assert len(accuracy.weights(WITHOUT, ("leaf",), (6.4,)).rows) == len(accuracy.SCHEMES)
    errors = numbers(accuracy.surfaces(WITHOUT, ("leaf",), (6.4,)), 2)
    assert len(errors) == len(accuracy.SCHEMES)
    assert 0 < min(errors) < 1


def test_noisy_and_uncertainty() -> None:
    assert 0 < numbers(noisy.noisy(WITHOUT, ("leaf",)), 2)[0] < 0.5
    assert 0.2 < numbers(noisy.uncertainty(WITHOUT, ("leaf",), 1), 1)[0] < 5


def test_lengths() -> None:
    (row,) = lengths.lengths(WITHOUT, ("leaf",)).rows
    wheel, measured, constant, unknown = (float(cell or 0) for cell in row[1:])
    assert 0 < wheel < 0.3
    assert wheel < measured < min(constant, unknown)


def test_given_lengths_are_those_between_nodes() -> None:
    shape, scan = leaf(), exact_scan(leaf(), 0.01)
    wrong = Scan(tuple(replace(c, distance=c.distance**2 + 5) for c in scan.curves))
    for known, curve in zip(shape.curves, lengths.with_lengths(wrong, shape.curves).curves, strict=True):
        assert curve.distance[curve.node_samples] == pytest.approx(known.node_positions)


def test_bends_through_nodes_make_normals_smoother_there() -> None:
    table = crossings.crossings(WITHOUT, ("cone",), 1)
    end, through = (numbers(table, column)[0] for column in (1, 2))
    assert through < 1.5 < end
    asymmetry, *errors = table.rows[0][3:]
    assert float(str(asymmetry)) > 0.01
    assert all(0 < float(str(error)) < 1 for error in errors)


def test_symmetric_shape_operators_are_reached_and_their_derivative_is_right() -> None:
    problem = crossings.Problem.of(noisy_scan("leaf"))
    stencil = Stencil(problem.samples.layout)
    data, operator = problem.samples.frames[stencil.representative], crossings.ShapeOperator(stencil)
    x = crossings.minimised(stencil, data, problem.weights, problem.start[stencil.representative])
    found = crossings.symmetric(stencil, data, problem.weights, x)
    assert np.abs(operator.defect(found)).max() < 1e-6 * np.abs(operator.defect(x)).max()
    w = np.random.default_rng(1).standard_normal((len(x), 3))
    ahead, behind = (operator.defect(x @ exp(e * w)) for e in (1e-6, -1e-6))
    np.testing.assert_allclose(operator.derivative(x) @ w.ravel(), (ahead - behind) / 2e-6, atol=1e-6)


def test_nodes() -> None:
    table = nodes.nodes(WITHOUT, ("leaf",), 1)
    assert [row[0] for row in table.rows] == ["leaf (built in), 1 scans", "all"]
    assert table.rows[0][1:] == table.rows[1][1:]
    assert 0.5 < float(table.rows[0][5] or 0) <= 1


def test_meetings_are_matched_once_and_round_closed_curves() -> None:
    scan = exact_scan(leaf(), 0.01)
    true = nodes.marked_meetings(scan)
    assert nodes.matches(scan, true, true) == dict.fromkeys(true, 0.0)
    first = true[0]
    assert scan.curves[first.curves[0]].closed
    length = float(np.ptp(scan.curves[first.curves[0]].distance))
    round_once = nodes.Meeting(first.curves, (first.places[0] - length + 0.01, first.places[1]))
    assert nodes.matches(scan, [first, first], [round_once]) == pytest.approx({round_once: 0.01})
    assert nodes.matches(scan, [first], [nodes.Meeting((0, 99), first.places)]) == {}


def test_partners_of_an_exact_network_are_its_points() -> None:
    network = leaf().network(0.02)
    assert noisy.partners(network, leaf().network(0.002)) == pytest.approx(network.points, abs=2e-5)


def test_times_and_regression() -> None:
    (row,) = times.times(WITHOUT, (96,), 1).rows
    assert 48 < int(row[2] or 0) < 192
    assert all(isinstance(cell, float) and cell > 0 for cell in row[3:6])
    (row,) = regression.regression(WITHOUT, (96,), 1).rows
    assert float(row[3] or 0) > 0
    assert row[6] == "not installed" or abs(float(row[7] or 1)) < 1e-6


def test_growth_fits_and_leaves_out_what_takes_too_long() -> None:
    table = growth.growth(WITHOUT, (300, 600), {"network": 60.0, "surface": 60.0})
    series = ("network", "surface")
    assert [row[0] for row in table.rows] == [row for name in series for row in (name, name, f"{name}: exponent")]
    none = growth.growth(WITHOUT, (300,), {"network": 0.0, "surface": 0.0})
    assert [row[2] for row in none.rows[:1]] == ["over 0 s"]


def test_meshes_of_all_shapes_and_scans_are_in_order(shared_data: Path) -> None:
    """Those of the folder's networks have a test of their own beside the truth, test_surface.py."""
    rows = meshes.meshes(Data(shared_data), with_networks=False).rows
    assert len(rows) >= 5 + 12 + 1
    assert [row for row in rows if row[-1] != "yes"] == []


def test_plain_energy_is_the_solvers_and_has_its_gradient_and_hessian() -> None:
    samples = regression.regression_problem(exact_scan(leaf(), 0.01), 0.08)
    stencil = Stencil(samples.layout)
    data = samples.frames[stencil.representative]
    weights = regression.thesis_weights(1, 100, 0.08)
    energy = ThesisEnergy(stencil, data, weights)
    generator = np.random.default_rng(1)
    frames, change = data + 0.1 * generator.normal(size=data.shape), generator.normal(size=data.shape)
    assert energy.cost(data) == pytest.approx(EnergyPoint(stencil, data, data, weights).value)
    step = 1e-5
    ahead, behind = frames + step * change, frames - step * change
    slope = (energy.cost(ahead) - energy.cost(behind)) / (2 * step)
    assert np.sum(energy.gradient(frames) * change) == pytest.approx(slope, rel=1e-6)
    bend = (energy.gradient(ahead) - energy.gradient(behind)) / (2 * step)
    assert energy.hessian(frames, change) == pytest.approx(bend, rel=1e-5, abs=1e-5 * np.abs(bend).max())


def test_arrays_are_quick_and_near_the_truth() -> None:
    table = arrays.arrays(WITHOUT, moments=2, repeats=1)
    assert [row[0] for row in table.rows] == ["ribbon", "comb", "lattice"]
    assert max(numbers(table, 5)) < 1
    assert max(numbers(table, 6)) < 3
