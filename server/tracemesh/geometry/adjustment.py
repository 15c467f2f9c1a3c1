"""Least-squares adjustment of a network: node positions, node normals, errors of whole curves; variances are known.

A network adjustment as in surveying, with the equations of `misclosure`; the solution is the most probable one, and the
factorised normal equations also yield draws from all that are probable.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, block_diag, coo_array, csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from tracemesh.geometry.bias import Variances
from tracemesh.geometry.misclosure import Misclosures

Floats = NDArray[np.float64]

_LEAST = 1e-30  # variance of what is not modelled: it stays zero


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


class Adjustment:
    """Normal equations of a network, factorised."""

    def __init__(self, misclosures: Misclosures, variances: Variances) -> None:
        """Factorise for given variances."""
        self._m = misclosures
        s, n = misclosures.segments, misclosures.normals
        by_s, by_n = 1 / np.sqrt(variances.segments), 1 / np.sqrt(variances.normals)
        self._rows: csc_array = block_array(
            [[-by_s * s.free, None, by_s * s.shared], [None, -by_n * n.free, by_n * n.shared]], format="csc"
        )
        self._right = np.concatenate([by_s * s.y, by_n * n.y])
        free = s.free.shape[1] + n.free.shape[1]
        c, m = misclosures.curves, misclosures.marks
        inverse = np.linalg.inv(variances.rotation + _LEAST * np.eye(3))
        rest = np.concatenate([np.full(c, 1 / (variances.scale + _LEAST)), np.full(m, 1 / (variances.shift + _LEAST))])
        self._root = block_diag(
            [coo_array((free, free)), *[np.linalg.cholesky(inverse)] * c, diags_array(np.sqrt(rest))], format="csc"
        )
        self._factors: SuperLU = splu((self._rows.T @ self._rows + self._root @ self._root.T).tocsc())

    def solution(self) -> Corrections:
        """The most probable corrections."""
        return self._split(self._factors.solve(self._rows.T @ self._right))

    def draws(self, count: int, random: np.random.Generator) -> Corrections:
        """Deviations from the solution, as probable as the truth's own; the first axis counts them."""
        noise = self._rows.T @ random.standard_normal((self._rows.shape[0], count))
        prior = self._root @ random.standard_normal((self._root.shape[1], count))
        return self._split(self._factors.solve(noise + prior).T)

    def _split(self, x: Floats) -> Corrections:
        c, m, nodes = self._m.curves, self._m.marks, self._m.layout.node_count
        head, moved = x.shape[:-1], 3 * (nodes - 1)
        still = np.zeros((*head, 1, 3))
        theta = x[..., moved + 2 * nodes :]
        return Corrections(
            np.concatenate([still, x[..., :moved].reshape(*head, -1, 3)], axis=-2),
            theta[..., : 3 * c].reshape(*head, c, 3),
            theta[..., 3 * c : 4 * c],
            theta[..., 4 * c : 4 * c + m],
        )
