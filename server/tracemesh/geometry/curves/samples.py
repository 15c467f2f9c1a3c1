"""Frames along all curves of a network, one after the other, cut into segments at nodes."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Layout:
    """Which sample belongs to which curve, segment and node; rows are samples of all curves one after the other.

    arc: (n,) m, arc length on the row's own curve, increasing. first: (c + 1,) first row of each curve.
    closed, boundary: (c,). marks: (m,) rows at nodes, increasing; the first and last row of every curve are among them.
    nodes: (m,) node at each mark, 0 to k - 1. is_node: (k,) false where a closed curve without nodes was merely
    started. A closed curve repeats its first row last.
    """

    arc: Floats
    first: Ints
    closed: Bools
    boundary: Bools
    marks: Ints
    nodes: Ints
    is_node: Bools

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.arc)

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.is_node)

    @cached_property
    def curve(self) -> Ints:
        """Curve of each row (n,)."""
        return np.repeat(np.arange(len(self.closed)), np.diff(self.first))

    @cached_property
    def edges(self) -> Ints:
        """Rows (e,) from which an edge leads to the next row of the same curve."""
        is_last = np.zeros(self.size, bool)
        is_last[self.first[1:] - 1] = True
        return np.flatnonzero(~is_last)

    @cached_property
    def lengths(self) -> Floats:
        """Length of each edge (e,), m."""
        return self.arc[self.edges + 1] - self.arc[self.edges]

    @cached_property
    def segments(self) -> Ints:
        """Marks (s,) from which a segment leads to the next mark of the same curve."""
        of_mark = self.curve[self.marks]
        return np.flatnonzero(of_mark[1:] == of_mark[:-1])

    @cached_property
    def segment_nodes(self) -> Ints:
        """Nodes (s, 2) at the start and end of each segment."""
        return np.stack([self.nodes[self.segments], self.nodes[self.segments + 1]], axis=1)

    @cached_property
    def segment_rows(self) -> Ints:
        """Rows (s, 2) at the start and end of each segment."""
        return np.stack([self.marks[self.segments], self.marks[self.segments + 1]], axis=1)

    @cached_property
    def segment_curve(self) -> Ints:
        """Curve of each segment (s,)."""
        return self.curve[self.marks[self.segments]]

    @cached_property
    def edge_segment(self) -> Ints:
        """Segment of each edge (e,)."""
        starts = np.zeros(self.size, np.int64)
        starts[self.segment_rows[:, 0]] = 1
        return np.cumsum(starts[self.edges]) - 1

    @cached_property
    def row_segment(self) -> Ints:
        """Segment (n,) of each row; a node's is the one that begins there, or ends where none begins."""
        segment = np.empty(self.size, np.int64)
        segment[self.edges + 1] = self.edge_segment
        segment[self.edges] = self.edge_segment
        return segment

    @cached_property
    def segment_lengths(self) -> Floats:
        """Length of each segment (s,), m."""
        return self.arc[self.segment_rows[:, 1]] - self.arc[self.segment_rows[:, 0]]


@dataclass(frozen=True)
class NetworkSamples:
    """Frames [t N B] (n, 3, 3), world, at the rows of a layout."""

    layout: Layout
    frames: Floats

    def first_curves(self, count: int) -> "NetworkSamples":
        """Only the first curves, at least one."""
        full = self.layout
        rows = full.first[count]
        marks = full.marks[full.marks < rows]
        layout = replace(
            full,
            arc=full.arc[:rows],
            first=full.first[: count + 1],
            closed=full.closed[:count],
            boundary=full.boundary[:count],
            marks=marks,
            nodes=full.nodes[: len(marks)],
        )
        return NetworkSamples(layout, self.frames[:rows])
