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
from tracemesh.geometry.rotations import exp, hat

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_E_N = hat(np.array([0.0, 1.0, 0.0]))


@dataclass(frozen=True)
class Weights:
    """Smoothing lengths in metres: stretch^2 is lambda and bend^4 is mu of Eq. 3.30."""

    stretch: float
    bend: float


def _entries_first(matrix: Floats) -> Floats:
    """Matrices (k, 3, 3) as (3, 3, k): every entry of all of them is contiguous, which makes all below fast."""
    return np.ascontiguousarray(matrix.transpose(1, 2, 0))


def _transposed(matrix: Floats) -> Floats:
    return np.swapaxes(matrix, 0, 1)


def _product(left: Floats, right: Floats) -> Floats:
    """Products L^T R (3, 3, k) of matrices (3, 3, k)."""
    result: Floats = np.einsum("lik,ljk->ijk", left, right)
    return result


def _trace(matrix: Floats) -> Floats:
    result: Floats = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    return result


def _skew_vector(matrix: Floats) -> Floats:
    """Vectors (3, k) with hat(v) = M - M^T for matrices (3, 3, k)."""
    return np.stack([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])


def _curl(matrix: Floats) -> Floats:
    """tr(M) I - M: the derivative of 2 vee(skew(M exp(w))) at w = 0, transposed."""
    result = -matrix
    trace = _trace(matrix)
    for i in range(3):
        result[i, i] += trace
    return result


def _apply(matrix: Floats, vector: Floats) -> Floats:
    """Products (3, k) of matrices (3, 3, k) and vectors (3, k)."""
    result: Floats = np.einsum("ijk,jk->ik", matrix, vector)
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
        self._x, self._data = _entries_first(frames), trust * stencil.data
        self._stiffness = softening * stencil.stiffness
        self._s, self._stretch, self._bend = stencil, weights.stretch**2, weights.bend**4
        s, n = stencil, self._x[:, 1]
        self._fit = _product(_entries_first(data), self._x)
        self._turn = _product(self._x.take(s.left, axis=2), self._x.take(s.right, axis=2))
        self._rate = _skew_vector(self._turn)  # 2 vee(skew), of which bends are differences
        self._bends = 0.5 * (self._rate[:, s.edge_out] / s.h_out - self._rate[:, s.edge_in] / s.h_in)
        self._bend_weight = self._bend * 8 / (s.h_in + s.h_out)
        self._split = n[:, s.pair[:, 0]] - n[:, s.pair[:, 1]]
        self.value = float(
            2 * self._data @ (3 - _trace(self._fit))
            + 2 * self._stretch * np.sum((3 - _trace(self._turn)) / s.h)
            + 0.5 * np.sum(self._bends**2 @ self._bend_weight)
            + self._stiffness * np.sum(self._split**2)
        )

    @property
    def frames(self) -> Floats:
        """Where it is (u, 3, 3)."""
        return self._x.transpose(2, 0, 1)

    def moved(self, step: Floats) -> Floats:
        """Frames (u, 3, 3) after a step (u, 3), rad."""
        turned: Floats = np.einsum("ilk,ljk->ijk", self._x, _entries_first(exp(step)))
        return turned.transpose(2, 0, 1)

    def gradient(self) -> Floats:
        """Derivative (u, 3) with respect to w in X exp(w)."""
        s = self._s
        gradient: Floats = 2 * self._data * _skew_vector(self._fit)
        force = (2 * self._stretch / s.h) * self._rate
        gradient[:, s.right] += force
        gradient[:, s.left] -= force
        self._add_bends(gradient)
        for unknown, sign in zip(s.pair.T, (2.0, -2.0), strict=True):
            own = sign * self._stiffness * _apply(_transposed(self._x[:, :, unknown]), self._split)
            gradient[0] += np.bincount(unknown, own[2], s.size)  # e_N x own
            gradient[2] -= np.bincount(unknown, own[0], s.size)
        return gradient.T

    def _add_bends(self, gradient: Floats) -> None:
        s = self._s
        pull = (self._bend_weight / 2) * self._bends
        ahead, behind = pull / s.h_out, pull / s.h_in
        out, into = self._turn.take(s.edge_out, axis=2), self._turn.take(s.edge_in, axis=2)
        along_out, along_in = _trace(out) * ahead, _trace(into) * behind
        gradient[:, s.after] += along_out - _apply(out, ahead)
        gradient[:, s.before] += along_in - _apply(_transposed(into), behind)
        gradient[:, s.centre] -= along_out - _apply(_transposed(out), ahead) + along_in - _apply(into, behind)

    def hessian_blocks(self) -> Floats:
        """Blocks (3, 3, k) of the Hessian at the places of `pattern_of`."""
        s = self._s
        curl = _curl(self._fit)
        diagonal = self._data * (curl + _transposed(curl))
        curl = _curl(self._turn)
        across = (-2 * self._stretch / s.h) * _transposed(curl)
        if self._stretch:
            diagonal[:, :, s.left] -= (across + _transposed(across)) / 2
            diagonal[:, :, s.right] -= (across + _transposed(across)) / 2
        return np.concatenate([diagonal, across, *self._bend_blocks(curl), *self._node_blocks()], axis=2)

    def _bend_blocks(self, curl: Floats) -> list[Floats]:
        """Blocks of J^T J for J, the derivative of the bends with respect to the unknowns before, at and after them."""
        s = self._s
        root = 0.5 * np.sqrt(self._bend_weight)
        out, into = root / s.h_out * curl.take(s.edge_out, axis=2), root / s.h_in * curl.take(s.edge_in, axis=2)
        jacobian = [into, -out - _transposed(into), np.ascontiguousarray(_transposed(out))]
        return [_product(left, right) for left, right in combinations_with_replacement(jacobian, 2)]

    def _node_blocks(self) -> list[Floats]:
        (p, q), weight = self._s.pair.T, 2 * self._stiffness
        j_p, j_q = (np.einsum("ilk,lj->ijk", self._x[:, :, k], _E_N) for k in (p, q))
        return [weight * _product(j_p, j_p), weight * _product(j_q, j_q), -weight * _product(j_p, j_q)]
