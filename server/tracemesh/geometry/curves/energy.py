"""The smoothing energy on SO(3) and its second-order model (thesis 3.5.4, Eq. 3.26-3.30).

    E = sum h |X_k - A_k|^2 + stretch^2 sum |X_k - X_{k+1}|^2 / h
        + bend^4 sum |skew(X_k^T (X_{k+1}/h_+ + X_{k-1}/h_-))|^2 / h_k + stiffness sum_nodes |N_j - N_l|^2

The data term carries h, so that stretch and bend are lengths in metres and the minimiser does not depend on h. A step
is X_k <- X_k exp(w_k). Its Hessian is exact for the first two terms and Gauss-Newton for the others.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.stencil import Pattern, Stencil
from tracemesh.geometry.rotations import hat, skew_vector

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_E_N = hat(np.array([0.0, 1.0, 0.0]))


@dataclass(frozen=True)
class Weights:
    """Smoothing lengths in metres: stretch^2 is lambda and bend^4 is mu of Eq. 3.30."""

    stretch: float
    bend: float


def _transposed(matrix: Floats) -> Floats:
    return np.swapaxes(matrix, -1, -2)


def _trace(matrix: Floats) -> Floats:
    result: Floats = matrix[..., 0, 0] + matrix[..., 1, 1] + matrix[..., 2, 2]
    return result


def _curl(matrix: Floats) -> Floats:
    """tr(M) I - M: the derivative of 2 vee(skew(M exp(w))) at w = 0, transposed."""
    result = -matrix
    trace = _trace(matrix)
    for i in range(3):
        result[..., i, i] += trace
    return result


def _apply(matrix: Floats, vector: Floats) -> Floats:
    """Products (k, 3) of matrices (k, 3, 3) and vectors (k, 3)."""
    result: Floats = np.einsum("kij,kj->ki", matrix, vector)
    return result


def pattern_of(stencil: Stencil) -> Pattern:
    """Pattern of the Hessian: data and stretch on the diagonal, stretch beside it, bends, nodes."""
    b, c, a = stencil.before, stencil.centre, stencil.after
    p, q = stencil.pair.T
    rows = [np.arange(stencil.size), stencil.left, b, b, b, c, c, a, p, q, p]
    columns = [np.arange(stencil.size), stencil.right, b, c, a, c, a, a, p, q, q]
    return Pattern(np.concatenate(rows), np.concatenate(columns), stencil.size)


class EnergyPoint:
    """The energy at frames (u, 3, 3) for data frames (u, 3, 3): value at once, derivatives when asked for."""

    def __init__(
        self,
        stencil: Stencil,
        frames: Floats,
        data: Floats,
        weights: Weights,
        softening: float = 1.0,
        trust: Floats | float = 1.0,
    ) -> None:
        """Find the value; softening: factor on the stiffness of the nodes. trust: (u,) factors on the data's weight."""
        self.frames, self._data = frames, trust * stencil.data
        self._stiffness = softening * stencil.stiffness
        self._s, self._stretch, self._bend = stencil, weights.stretch**2, weights.bend**4
        s, n = stencil, frames[:, :, 1]
        self._fit = _transposed(data) @ frames
        self._turn = _transposed(frames[s.left]) @ frames[s.right]
        self._rate = skew_vector(self._turn)  # 2 vee(skew), of which bends are differences
        self._bends = 0.5 * (self._rate[s.edge_out] / s.h_out[:, None] - self._rate[s.edge_in] / s.h_in[:, None])
        self._bend_weight = self._bend * 8 / (s.h_in + s.h_out)
        self._split = n[s.pair[:, 0]] - n[s.pair[:, 1]]
        self.value = float(
            2 * np.sum(self._data * (3 - _trace(self._fit)))
            + 2 * self._stretch * np.sum((3 - _trace(self._turn)) / s.h)
            + 0.5 * np.sum(self._bend_weight * np.sum(self._bends**2, axis=1))
            + self._stiffness * np.sum(self._split**2)
        )

    def gradient(self) -> Floats:
        """Derivative (u, 3) with respect to w in X exp(w)."""
        s = self._s
        gradient: Floats = 2 * self._data[:, None] * skew_vector(self._fit)
        force = (2 * self._stretch / s.h)[:, None] * self._rate
        gradient[s.right] += force
        gradient[s.left] -= force
        self._add_bends(gradient)
        for unknown, sign in zip(s.pair.T, (2.0, -2.0), strict=True):
            torque = np.cross([0.0, 1.0, 0.0], _apply(_transposed(self.frames[unknown]), self._split))
            np.add.at(gradient, unknown, sign * self._stiffness * torque)
        return gradient

    def _add_bends(self, gradient: Floats) -> None:
        s = self._s
        pull = (self._bend_weight / 2)[:, None] * self._bends
        ahead, behind = pull / s.h_out[:, None], pull / s.h_in[:, None]
        out, into = self._turn[s.edge_out], self._turn[s.edge_in]
        along_out, along_in = _trace(out)[:, None] * ahead, _trace(into)[:, None] * behind
        gradient[s.after] += along_out - _apply(out, ahead)
        gradient[s.before] += along_in - _apply(_transposed(into), behind)
        gradient[s.centre] -= along_out - _apply(_transposed(out), ahead) + along_in - _apply(into, behind)

    def hessian_blocks(self) -> Floats:
        """Blocks (k, 3, 3) of the Hessian at the places of `pattern_of`."""
        s = self._s
        curl = _curl(self._fit)
        diagonal = self._data[:, None, None] * (curl + _transposed(curl))
        curl = _curl(self._turn)
        across = (-2 * self._stretch / s.h)[:, None, None] * _transposed(curl)
        if self._stretch:
            diagonal[s.left] -= (across + _transposed(across)) / 2
            diagonal[s.right] -= (across + _transposed(across)) / 2
        return np.concatenate([diagonal, across, self._bend_blocks(curl), self._node_blocks()])

    def _bend_blocks(self, curl: Floats) -> Floats:
        """Blocks of J^T J for J, the derivative of the bends with respect to the unknowns before, at and after them."""
        s = self._s
        root = 0.5 * np.sqrt(self._bend_weight)
        out = (root / s.h_out)[:, None, None] * curl[s.edge_out]
        into = (root / s.h_in)[:, None, None] * curl[s.edge_in]
        jacobian = [into, -out - _transposed(into), _transposed(out)]
        blocks = np.empty((6, len(into), 3, 3))
        for k, (i, j) in enumerate(combinations_with_replacement(range(3), 2)):
            np.matmul(_transposed(jacobian[i]), jacobian[j], out=blocks[k])
        return blocks.reshape(-1, 3, 3)

    def _node_blocks(self) -> Floats:
        (p, q), weight = self._s.pair.T, 2 * self._stiffness
        j_p, j_q = -self.frames[p] @ _E_N, self.frames[q] @ _E_N
        left = weight * _transposed(j_p)
        return np.concatenate([left @ j_p, weight * _transposed(j_q) @ j_q, left @ j_q])
