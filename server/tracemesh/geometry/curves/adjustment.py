"""Least-squares adjustment of a network: node positions, node normals, errors of whole curves; variances are known.

A network adjustment as in surveying, with the equations of `misclosure`; the solution is the most probable one, and the
factorised normal equations also yield draws from all that are probable.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, block_diag, coo_array, csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from tracemesh.geometry.curves.bias import Variances
from tracemesh.geometry.curves.misclosure import Misclosures

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Corrections:
    """What the adjustment changes, of shape (..., k, 3), (..., c, 3), (..., c) and (..., m).

    nodes: m, from the unadjusted positions. rotation: rad, world, to apply to a curve's frames. scale: relative, to add
    to its lengths. shift: m, to add to the distance of each mark.
    """

    nodes: Floats
    rotation: Floats
    scale: Floats
    shift: Floats

    def followed_by(self, second: "Corrections") -> "Corrections":
        """These and then others, found on the corrected curves; they add, but for products of small numbers."""
        return Corrections(*(a + b for a, b in zip(vars(self).values(), vars(second).values(), strict=True)))


class Adjustment:
    """Normal equations of a network, factorised."""

    def __init__(self, misclosures: Misclosures, variances: Variances, before: Corrections | None = None) -> None:
        """Factorise for given variances; before: corrections made already, which count as much as those to come."""
        self._m = misclosures
        s, n = misclosures.segments, misclosures.normals
        by_s, by_n = 1 / np.sqrt(variances.segments), 1 / np.sqrt(variances.normals)
        parts = [[-by_s * s.free, None], [None, -by_n * n.free]]
        self._free = s.free.shape[1] + n.free.shape[1]
        if variances.with_bias:
            parts = [[*parts[0], by_s * s.shared], [*parts[1], by_n * n.shared]]
        self._rows: csc_array = block_array(parts, format="csc")
        right = np.concatenate([by_s * s.y, by_n * n.y])
        self._root = self._prior_root(variances)
        self._pull = self._rows.T @ right
        if before is not None:
            theta = np.concatenate([before.rotation.ravel(), before.scale, before.shift])
            self._pull[self._free :] -= (self._root @ self._root.T)[self._free :, self._free :] @ theta
        self._factors: SuperLU = splu((self._rows.T @ self._rows + self._root @ self._root.T).tocsc())

    def _prior_root(self, variances: Variances) -> csc_array:
        """Root R of the precision R R^T of what is known beforehand: nothing of the free unknowns."""
        free = coo_array((self._free, self._free))
        if not variances.with_bias:
            return free.tocsc()
        c, m = self._m.curves, self._m.marks
        rotation = np.linalg.cholesky(np.linalg.inv(variances.rotation))
        rest = np.concatenate([np.full(c, variances.scale**-0.5), np.full(m, variances.shift**-0.5)])
        return csc_array(block_diag([free, *[rotation] * c, diags_array(rest)]))

    def solution(self) -> Corrections:
        """The most probable corrections."""
        return self._split(self._factors.solve(self._pull))

    def draws(self, count: int, random: np.random.Generator) -> Corrections:
        """Deviations from the solution, as probable as the truth's own; the first axis counts them."""
        noise = self._rows.T @ random.standard_normal((self._rows.shape[0], count))
        prior = self._root @ random.standard_normal((self._root.shape[1], count))
        return self._split(self._factors.solve(noise + prior).T)

    def _split(self, x: Floats) -> Corrections:
        """Corrections from a vector of unknowns (..., u); what was not modelled is zero."""
        c, m, nodes = self._m.curves, self._m.marks, self._m.layout.node_count
        head, moved = x.shape[:-1], 3 * (nodes - 1)
        theta = x[..., self._free :] if x.shape[-1] > self._free else np.zeros((*head, self._m.size))
        return Corrections(
            np.concatenate([np.zeros((*head, 1, 3)), x[..., :moved].reshape(*head, -1, 3)], axis=-2),
            theta[..., : 3 * c].reshape(*head, c, 3),
            theta[..., 3 * c : 4 * c],
            theta[..., 4 * c : 4 * c + m],
        )
