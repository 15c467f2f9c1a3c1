"""The part of a scan under way that can be solved."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh.geometry.scan import CurveScan
from tracemesh.jobs.attached import largest_piece


def curve(nodes: list[int], samples: int) -> CurveScan:
    line = np.zeros((samples, 3))
    return CurveScan(np.arange(samples, dtype=float), line, line, np.arange(len(nodes)), np.array(nodes, np.int64))


def obviously(curves: list[CurveScan]) -> list[int]:
    """Every curve spreads its number to those that share a node, until nothing changes."""
    label = list(range(len(curves)))
    for _ in curves:
        for i, j in combinations(range(len(curves)), 2):
            if set(curves[i].node_ids.tolist()) & set(curves[j].node_ids.tolist()):
                label[i] = label[j] = min(label[i], label[j])
    pieces = [[i for i in range(len(curves)) if label[i] == name] for name in sorted(set(label))]
    return max(pieces, key=lambda piece: sum(len(curves[i].distance) for i in piece), default=[])


@settings(max_examples=60)
@given(st.lists(st.tuples(st.lists(st.integers(0, 7), max_size=3), st.integers(3, 9)), max_size=7))
def test_the_largest_piece_is_the_obvious_one(drawn: list[tuple[list[int], int]]) -> None:
    curves = [curve(nodes, samples) for nodes, samples in drawn]
    assert largest_piece(curves, range(len(curves))) == obviously(curves)


@pytest.mark.parametrize(("candidates", "expected"), [([0, 1, 2], [0, 1]), ([0, 2], [2]), ([], [])])
def test_only_candidates_count(candidates: list[int], expected: list[int]) -> None:
    curves = [curve([0, 1], 5), curve([1, 2], 5), curve([2, 3], 9)]
    curves[2] = curve([7, 8], 9)
    assert largest_piece(curves, candidates) == expected
