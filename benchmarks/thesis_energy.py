"""The thesis's energy on SO(3)^n (Eq. 3.30) written plainly, for a general Riemannian optimiser to minimise.

E = sum d_k |X_k - A_k|^2 + stretch^2 sum |X_k - X_{k+1}|^2 / h
    + bend^4 sum |skew(X_k^T Y_k)|^2 / h_k + stiffness sum_nodes |N_p - N_q|^2,   Y_k = X_{k+1} / h_+ + X_{k-1} / h_-
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.measuring import Floats
from tracemesh.geometry.curves.energy import Weights
from tracemesh.geometry.curves.stencil import Stencil


@dataclass(frozen=True)
class ThesisEnergy:
    """stencil: who is coupled with whom. data: A (n, 3, 3), frames as measured."""

    stencil: Stencil
    data: Floats
    weights: Weights

    def cost(self, frames: Floats) -> float:
        """E at frames X (n, 3, 3)."""
        s = self.stencil
        bent = _skew(_transposed(frames[s.centre]) @ self._neighbours(frames))
        along, normals = frames[s.right] - frames[s.left], frames[:, :, 1]
        return float(
            s.data @ _squares(frames - self.data)
            + self.weights.stretch**2 * np.sum(_squares(along) / s.h)
            + np.sum(self._bend() * _squares(bent))
            + s.stiffness * np.sum((normals[s.pair[:, 0]] - normals[s.pair[:, 1]]) ** 2)
        )

    def gradient(self, frames: Floats) -> Floats:
        """Euclidean gradient (n, 3, 3)."""
        s = self.stencil
        centre, neighbours = frames[s.centre], self._neighbours(frames)
        bent = _skew(_transposed(centre) @ neighbours)
        result = self._quadratic(frames, 2 * s.data[:, None, None] * (frames - self.data))
        self._add_bend(result, -neighbours @ bent, centre @ bent)
        return result

    def hessian(self, frames: Floats, change: Floats) -> Floats:
        """Derivative (n, 3, 3) of the gradient in the direction of a change (n, 3, 3)."""
        s = self.stencil
        centre, neighbours = frames[s.centre], self._neighbours(frames)
        centre_change, neighbours_change = change[s.centre], self._neighbours(change)
        bent = _skew(_transposed(centre) @ neighbours)
        bent_change = _skew(_transposed(centre_change) @ neighbours + _transposed(centre) @ neighbours_change)
        result = self._quadratic(change, 2 * s.data[:, None, None] * change)
        self._add_bend(
            result, -neighbours_change @ bent - neighbours @ bent_change, centre_change @ bent + centre @ bent_change
        )
        return result

    def _quadratic(self, frames: Floats, result: Floats) -> Floats:
        """`result` and the gradient of the stretch and node terms, which is linear."""
        s = self.stencil
        pull = (2 * self.weights.stretch**2 / s.h)[:, None, None] * (frames[s.right] - frames[s.left])
        np.add.at(result, s.right, pull)
        np.add.at(result, s.left, -pull)
        p, q = s.pair.T
        twist = 2 * s.stiffness * (frames[p, :, 1] - frames[q, :, 1])
        np.add.at(result[:, :, 1], p, twist)
        np.add.at(result[:, :, 1], q, -twist)
        return result

    def _add_bend(self, result: Floats, at_centre: Floats, at_neighbours: Floats) -> None:
        s = self.stencil
        weight = 2 * self._bend()[:, None, None]
        np.add.at(result, s.centre, weight * at_centre)
        np.add.at(result, s.after, weight * at_neighbours / s.h_out[:, None, None])
        np.add.at(result, s.before, weight * at_neighbours / s.h_in[:, None, None])

    def _bend(self) -> Floats:
        return np.asarray(self.weights.bend**4 * 2 / (self.stencil.h_in + self.stencil.h_out))

    def _neighbours(self, frames: Floats) -> Floats:
        s = self.stencil
        return np.asarray(frames[s.after] / s.h_out[:, None, None] + frames[s.before] / s.h_in[:, None, None])


def _transposed(matrices: Floats) -> Floats:
    return np.swapaxes(matrices, 1, 2)


def _skew(matrices: Floats) -> Floats:
    return (matrices - _transposed(matrices)) / 2


def _squares(matrices: Floats) -> Floats:
    return np.asarray((matrices**2).sum((1, 2)))
