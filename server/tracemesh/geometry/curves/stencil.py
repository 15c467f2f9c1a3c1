"""Unknown frames of a network, who is coupled with whom, and the sparsity pattern that follows."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from tracemesh.geometry.curves.samples import Layout

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_NORMAL_STIFFNESS = 1e5  # times the mean length of a curve: xi of Eq. 3.30 (there 1e4), independent of the unit


class Stencil:
    """Unknowns of a layout and their couplings; a closed curve's last row is its first unknown.

    row: (n,) unknown of each layout row; representative: (u,) layout row of each unknown. left, right, h: (e,) unknowns
    and length of edges. before, centre, after: (b,) unknowns at bends; edge_in, edge_out, h_in, h_out: (b,) their
    edges. data: (u,) m, length that each unknown stands for. pair: (p, 2) unknowns at the same node, every two once.
    stiffness: m, weight of the difference of their normals.
    """

    def __init__(self, layout: Layout) -> None:
        """Number the unknowns."""
        is_repeat = np.zeros(layout.size, bool)
        is_repeat[layout.first[1:][layout.closed] - 1] = True
        self.row: Ints = np.cumsum(~is_repeat) - 1
        self.row[is_repeat] = self.row[layout.first[:-1][layout.closed]]
        self.representative: Ints = np.flatnonzero(~is_repeat)
        self.size = len(self.representative)
        self.left, self.right, self.h = self.row[layout.edges], self.row[layout.edges + 1], layout.lengths
        incoming, outgoing = np.full(self.size, -1), np.full(self.size, -1)
        incoming[self.right] = np.arange(len(self.h))
        outgoing[self.left] = np.arange(len(self.h))
        self.centre: Ints = np.flatnonzero((incoming >= 0) & (outgoing >= 0))
        self.edge_in, self.edge_out = incoming[self.centre], outgoing[self.centre]
        self.before, self.after = self.left[self.edge_in], self.right[self.edge_out]
        self.h_in, self.h_out = self.h[self.edge_in], self.h[self.edge_out]
        self.data = np.bincount(self.left, self.h / 2, self.size) + np.bincount(self.right, self.h / 2, self.size)
        self.pair = _node_pairs(layout, self.row)
        self.stiffness = _NORMAL_STIFFNESS * float(self.h.sum()) / len(layout.closed)


def _node_pairs(layout: Layout, row: Ints) -> Ints:
    """Every two different unknowns at the same node (p, 2)."""
    node, unknown = np.unique(np.stack([layout.nodes, row[layout.marks]], axis=1), axis=0).T
    first = np.searchsorted(node, node)  # where the run of this node begins
    rank = np.arange(len(node)) - first
    second = np.repeat(np.arange(len(node)), rank)
    partner = np.arange(len(second)) - np.repeat(np.cumsum(rank) - rank, rank) + first[second]
    return np.stack([unknown[partner], unknown[second]], axis=1)


class Pattern:
    """Upper sparsity pattern, found once, of matrices (3u, 3u) that are sums of 3 x 3 blocks at fixed places.

    matrix: the pattern with arbitrary entries. diagonal: (3u,) places of the diagonal among the entries.
    """

    def __init__(self, block_row: Ints, block_column: Ints, size: int) -> None:
        """block_row, block_column: (k,) place of each block; one below the diagonal is transposed."""
        self._below = np.flatnonzero(block_row > block_column)
        row, column = np.minimum(block_row, block_column), np.maximum(block_row, block_column)
        keys, slot = np.unique(column * size + row, return_inverse=True)
        self._sum = csr_array((np.ones(len(slot)), (slot, np.arange(len(slot)))), shape=(len(keys), len(slot)))
        row, column = keys % size, keys // size
        count = np.bincount(column, minlength=size)
        block, j = np.divmod(np.arange(3 * len(keys)), 3)
        order = np.lexsort((block, j, column[block]))  # entries column by column, three rows of a block at a time
        block, j = block[order], j[order]
        entry = (j * len(keys) + block)[:, None] + 3 * len(keys) * np.arange(3)
        index = (3 * row[block])[:, None] + np.arange(3)
        upper = index <= (3 * column[block] + j)[:, None]
        self._entry = entry[upper]
        lengths = (3 * np.repeat(count, 3).reshape(-1, 3) - np.array([2, 1, 0])).ravel()
        indptr = np.concatenate([[0], np.cumsum(lengths)])
        self.matrix = csc_array((np.ones(len(self._entry)), index[upper], indptr), shape=(3 * size, 3 * size))
        self.diagonal: Ints = indptr[1:] - 1

    def entries(self, blocks: Floats) -> Floats:
        """Entries of the pattern summed from blocks (3, 3, k) in the order of construction; changes the blocks."""
        if len(self._below):
            blocks[:, :, self._below] = np.swapaxes(blocks[:, :, self._below], 0, 1)
        sums = np.concatenate([self._sum @ entry for entry in blocks.reshape(9, -1)])
        return np.asarray(sums[self._entry])
