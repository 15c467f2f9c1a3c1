"""A closed curve may be begun anywhere: from its first node on it is the same curve."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.geometry.curves.closed_curves import from_first_node
from tracemesh.geometry.scan import CurveScan


def circle(ids: list[int], samples: list[int]) -> CurveScan:
    angle = np.linspace(0, 2 * np.pi, 61)
    tangent = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    normal = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    marks, nodes = np.array(samples, np.int64), np.array(ids, np.int64)
    return CurveScan(0.5 + angle, tangent, normal, marks, nodes, True, True, time=np.arange(61.0))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 59), min_size=1, max_size=5, unique=True).map(sorted))
def test_it_goes_once_around_from_node_to_node(samples: list[int]) -> None:
    curve = circle(list(range(len(samples))), samples)
    turned = from_first_node(curve)
    assert turned.node_ids.tolist() == [*range(len(samples)), 0]
    assert (turned.node_samples[0], turned.node_samples[-1]) == (0, 60)
    np.testing.assert_allclose(np.diff(turned.distance), 2 * np.pi / 60)
    assert np.ptp(turned.distance) == pytest.approx(2 * np.pi)
    for sample, place in zip(samples, turned.node_samples[:-1], strict=True):
        np.testing.assert_allclose(turned.normal[place], curve.normal[sample], atol=1e-12)
        assert turned.time is not None
        assert turned.time[place] == sample
    np.testing.assert_allclose(turned.tangent[0], turned.tangent[-1], atol=1e-12)


def test_a_curve_that_already_ends_where_it_begins_is_left_alone() -> None:
    done, bare = circle([3, 4, 3], [0, 20, 60]), circle([], [])
    assert from_first_node(done) is done
    assert from_first_node(bare) is bare
