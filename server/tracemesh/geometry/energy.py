"""The smoothing energy on SO(3) and its second-order model (thesis 3.5.4, Eq. 3.26-3.30).

    E = sum h |X_k - A_k|^2 + stretch^2 sum |X_k - X_{k+1}|^2 / h
        + bend^4 sum |skew(X_k^T (X_{k+1}/h_+ + X_{k-1}/h_-))|^2 / h_k + stiffness sum_nodes |N_j - N_l|^2

The data term carries h, so that stretch and bend are lengths in metres and the minimiser does not depend on h. A step
is X_k <- X_k exp(w_k). Its Hessian is exact for the first two terms and Gauss-Newton for the others.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from tracemesh.geometry.rotations import hat, skew_vector
from tracemesh.geometry.samples import Layout

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_NORMAL_STIFFNESS = 1e4  # xi of Eq. 3.30, times the mean length of a curve to be independent of the unit


@dataclass(frozen=True)
class Weights:
    """Smoothing lengths in metres: stretch^2 is lambda and bend^4 is mu of Eq. 3.30."""

    stretch: float
    bend: float


def _transposed(matrix: Floats) -> Floats:
    return np.swapaxes(matrix, -1, -2)


def _curl(matrix: Floats) -> Floats:
    """tr(M) I - M: the derivative of 2 vee(skew(M exp(w))) at w = 0, transposed."""
    result: Floats = np.trace(matrix, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - matrix
    return result


class Stencil:
    """Unknowns of a layout and who is coupled with whom; a closed curve's last row is its first unknown.

    row: (n,) unknown of each layout row; representative: (u,) layout row of each unknown.
    left, right, h: (e,) unknowns and length of edges. before, centre, after: (b,) unknowns at bends.
    pair: (p, 2) unknowns that share a node, every two of them once.
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
        incoming = np.full(self.size, -1)
        outgoing = np.full(self.size, -1)
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
    unknown = row[layout.marks]
    node_unknown = np.unique(np.stack([layout.nodes, unknown], axis=1), axis=0)
    node, unknown = node_unknown.T
    first = np.searchsorted(node, node)  # where the run of this node begins
    rank = np.arange(len(node)) - first
    second = np.repeat(np.arange(len(node)), rank)
    partner = np.arange(len(second)) - np.repeat(np.cumsum(rank) - rank, rank) + first[second]
    return np.stack([unknown[partner], unknown[second]], axis=1)


class Pattern:
    """Upper sparsity pattern, found once, of matrices (3u, 3u) that are sums of 3 x 3 blocks at fixed places."""

    def __init__(self, block_row: Ints, block_column: Ints, size: int) -> None:
        """block_row, block_column: (k,) place of each block; one below the diagonal is transposed."""
        swap = block_row > block_column
        self._swap = np.flatnonzero(swap)
        rows = np.where(swap, block_column, block_row)
        columns = np.where(swap, block_row, block_column)
        i, j = np.divmod(np.arange(9), 3)
        row = (3 * rows[:, None] + i).ravel()
        column = (3 * columns[:, None] + j).ravel()
        used = np.flatnonzero(row <= column)
        keys, slot = np.unique(column[used] * (3 * size) + row[used], return_inverse=True)
        self._gather = csr_array((np.ones(len(used)), (slot, used)), shape=(len(keys), len(row)))
        indptr = np.searchsorted(keys // (3 * size), np.arange(3 * size + 1))
        self.matrix = csc_array((np.ones(len(keys)), keys % (3 * size), indptr), shape=(3 * size, 3 * size))
        self.diagonal = indptr[1:] - 1

    def values(self, blocks: Floats) -> Floats:
        """Entries of the pattern summed from blocks (k, 3, 3) in the order of construction."""
        if len(self._swap):
            blocks[self._swap] = _transposed(blocks[self._swap])
        return np.asarray(self._gather @ blocks.ravel())


class Energy:
    """Value, gradient and second-order model of the energy over one stencil."""

    def __init__(self, stencil: Stencil) -> None:
        """Find the pattern."""
        self._s = s = stencil
        u = np.arange(s.size)
        b, c, a = s.before, s.centre, s.after
        p, q = s.pair.T
        rows = [u, s.left, c, b, a, c, c, b, p, q, p]
        columns = [u, s.right, c, b, a, b, a, a, p, q, q]
        self.pattern = Pattern(np.concatenate(rows), np.concatenate(columns), s.size)

    def _bends(self, turn: Floats) -> Floats:
        """vee(skew(X_k^T (X_+ / h_+ + X_- / h_-))) (b, 3); turn: X_left^T X_right (e, 3, 3)."""
        s = self._s
        v = 0.5 * skew_vector(turn)
        return np.asarray(v[s.edge_out] / s.h_out[:, None] - v[s.edge_in] / s.h_in[:, None])

    def value(self, frames: Floats, data: Floats, weights: Weights) -> float:
        """E at frames (u, 3, 3) for data frames (u, 3, 3)."""
        s = self._s
        turn = _transposed(frames[s.left]) @ frames[s.right]
        fit = np.einsum("n,nij->", s.data, (frames - data) ** 2)
        stretch = weights.stretch**2 * np.sum((6 - 2 * np.trace(turn, axis1=1, axis2=2)) / s.h)
        bends = self._bends(turn)
        bend = weights.bend**4 * np.sum(2 * np.sum(bends**2, axis=1) * 2 / (s.h_in + s.h_out))
        normals = frames[:, :, 1]
        nodes = s.stiffness * np.sum((normals[s.pair[:, 0]] - normals[s.pair[:, 1]]) ** 2)
        return float(fit + stretch + bend + nodes)

    def model(self, frames: Floats, data: Floats, weights: Weights) -> tuple[Floats, Floats]:
        """Gradient (u, 3) and entries of the Hessian in `pattern`, with respect to w in X exp(w)."""
        s = self._s
        gradient = np.zeros((s.size, 3))
        turn = _transposed(frames[s.left]) @ frames[s.right]
        diagonal = self._data_terms(frames, data, gradient)
        across = self._stretch_terms(turn, weights.stretch**2, gradient, diagonal)
        bends = self._bend_terms(turn, weights.bend**4, gradient)
        nodes = self._node_terms(frames, gradient)
        return gradient, self.pattern.values(np.concatenate([diagonal, across, *bends, *nodes]))

    def _data_terms(self, frames: Floats, data: Floats, gradient: Floats) -> Floats:
        weight = 2 * self._s.data
        residual = _transposed(data) @ frames
        gradient += weight[:, None] * skew_vector(residual)
        curl = _curl(residual)
        return weight[:, None, None] * (curl + _transposed(curl)) / 2

    def _stretch_terms(self, turn: Floats, factor: float, gradient: Floats, diagonal: Floats) -> Floats:
        s = self._s
        weight = 2 * factor / s.h
        force = weight[:, None] * skew_vector(turn)
        curl = weight[:, None, None] * _curl(turn)
        symmetric = (curl + _transposed(curl)) / 2
        for ends, sign in ((s.left, -1.0), (s.right, 1.0)):
            _add_at(gradient, ends, sign * force)
            _add_at(diagonal, ends, symmetric)
        return -_transposed(curl)

    def _bend_terms(self, turn: Floats, factor: float, gradient: Floats) -> list[Floats]:
        s = self._s
        weight = 4 * factor * 2 / (s.h_in + s.h_out)
        residual = self._bends(turn)
        curl = _curl(turn) / 2
        ahead = _transposed(curl[s.edge_out]) / s.h_out[:, None, None]  # d residual / d w_+
        behind = curl[s.edge_in] / s.h_in[:, None, None]  # d residual / d w_-
        here = -curl[s.edge_out] / s.h_out[:, None, None] - _transposed(curl[s.edge_in]) / s.h_in[:, None, None]
        weighted = [weight[:, None, None] * _transposed(j) for j in (here, behind, ahead)]
        for rows, j in zip((s.centre, s.before, s.after), weighted, strict=True):
            _add_at(gradient, rows, np.einsum("nij,nj->ni", j, residual))
        h, b, a = weighted
        return [h @ here, b @ behind, a @ ahead, h @ behind, h @ ahead, b @ ahead]

    def _node_terms(self, frames: Floats, gradient: Floats) -> list[Floats]:
        p, q = self._s.pair.T
        weight = 2 * self._s.stiffness
        e_n = hat(np.array([0.0, 1.0, 0.0]))
        j_p, j_q = -frames[p] @ e_n, frames[q] @ e_n
        residual = frames[p][:, :, 1] - frames[q][:, :, 1]
        np.add.at(gradient, p, weight * np.einsum("nji,nj->ni", j_p, residual))
        np.add.at(gradient, q, weight * np.einsum("nji,nj->ni", j_q, residual))
        left = weight * _transposed(j_p)
        return [left @ j_p, weight * _transposed(j_q) @ j_q, left @ j_q]


def _add_at(target: Floats, rows: Ints, values: Floats) -> None:
    """target[rows] += values for rows that are all different."""
    target[rows] += values
