"""Positions and normals propagated from the network into the patches (thesis sections 4.5.1 and 4.5.3).

One matrix B = C W C, with W the inverse mass, serves the base positions, the normals and the final solve: factored
once.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tracemesh.geometry.factorisation import Factorisation
from tracemesh.geometry.network import Floats
from tracemesh.geometry.surfaces.laplacian import Laplacian


class BiharmonicSolver:
    """Minimises the integral of |L V - H|^2 with the first vertices fixed (Eq. 4.12, 4.20-4.23).

    Rows of open-boundary vertices are left out (weight 0): there L V holds the boundary's conormal, not the curvature.
    """

    def __init__(
        self, laplacian: Laplacian, fixed: int, open_boundary: NDArray[np.bool_], pull: Floats | None = None
    ) -> None:
        """laplacian of n vertices; fixed: number of leading vertices that stay; open_boundary: (n,) mask.

        pull: (n,) weights of |V - W|^2 with the wanted values W of `solve`, 1/m^2.
        """
        self._fixed, self.mass = fixed, laplacian.mass
        weight = np.where(open_boundary, 0.0, 1.0 / laplacian.mass)
        self._gradient = (laplacian.stiffness[fixed:] @ sparse.diags(weight)).tocsr()
        matrix = (self._gradient @ laplacian.stiffness).tocsc()
        self._coupling = matrix[:, :fixed]
        self._pull = np.zeros(0) if pull is None else pull[fixed:]
        free = matrix[:, fixed:]
        self._factor = Factorisation(free if pull is None else free + sparse.diags(self._pull))

    def solve(self, known: Floats, laplacian_target: Floats | None = None, pulled_to: Floats | None = None) -> Floats:
        """(n, m) values with L V near a target.

        known: (fixed, m) values of the leading vertices. laplacian_target: (n, m), integrated over the vertices' areas;
        None is 0. pulled_to: (n, m) values W, for a solver with a pull.
        """
        right = -(self._coupling @ known)
        if laplacian_target is not None:
            right += self._gradient @ laplacian_target
        if pulled_to is not None:
            right += self._pull[:, None] * pulled_to[self._fixed :]
        return np.vstack([known, self._factor.solve(right)])
