"""Networks kept ready for previews: the same as made anew, within their budget."""

from dataclasses import replace

import numpy as np
import pytest

from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network, wanted_weights
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan
from tracemesh.jobs.warm import WarmNetworks, bytes_of, solve_warm
from tracemesh.wire.resources import ReconstructionParameters

BUDGET = 2**26


@pytest.mark.parametrize("bend", [0.0, 0.01, 0.05])
def test_whatever_was_solved_before_the_network_is_that_of_a_fresh_start(bend: float) -> None:
    scan, ready = exact_scan(leaf(), 0.01), WarmNetworks()
    for other in (0.02, 0.001):
        ready.get(("leaf", NetworkParameters()), scan, BUDGET).solve(wanted_weights(NetworkParameters(bend=other)))
    wanted = NetworkParameters(bend=bend)
    warm = ready.get(("leaf", NetworkParameters()), scan, BUDGET).solve(wanted_weights(wanted))
    assert warm.network.points == pytest.approx(reconstruct_network(scan, wanted).network.points, abs=1e-7)


def test_one_scan_cut_again_is_measured_once_and_is_that_of_a_fresh_start() -> None:
    scan, ready = exact_scan(leaf(), 0.01), WarmNetworks()
    coarse, fine = (NetworkParameters(step_fraction=fraction) for fraction in (0.04, 0.02))
    first, second = (ready.get(("leaf", parameters), scan, BUDGET) for parameters in (coarse, fine))
    assert second.measured is first.measured
    assert np.array_equal(second.solve().network.points, reconstruct_network(scan, fine).network.points)
    assert ready.get(("other leaf", fine), scan, BUDGET).measured is not first.measured


def test_a_scan_that_changed_is_made_ready_anew() -> None:
    scan, parameters = exact_scan(leaf(), 0.01), ReconstructionParameters(step="3%")
    larger = replace(scan, curves=tuple(replace(c, distance=2 * c.distance) for c in scan.curves))
    sizes = []
    for name, one in (("before", scan), ("after", larger)):
        solved = solve_warm(name, one, range(len(scan.curves)), parameters, BUDGET)
        sizes.append(np.ptp(solved.curves[0].positions, axis=0).max())
    assert sizes[1] == pytest.approx(2 * sizes[0])


def test_the_least_recently_used_go_first_and_the_last_one_stays() -> None:
    scan, ready = exact_scan(leaf(), 0.01), WarmNetworks()
    keys = [("leaf", NetworkParameters(step_fraction=step)) for step in (0.02, 0.03, 0.04)]
    first, second, _ = (ready.get(key, scan, BUDGET) for key in keys)
    assert ready.get(keys[0], scan, BUDGET) is first
    assert len(ready) == 3
    assert ready.get(keys[2], scan, 0) is not second
    assert len(ready) == 1
    assert ready.get(keys[0], scan, BUDGET) is not first


def test_arrays_are_counted_once_and_views_with_what_they_hold() -> None:
    array = np.zeros(1000)
    assert bytes_of([array, {"again": array}, (array[:10],)]) == array.nbytes
    assert bytes_of([array[:10]]) == array.nbytes
