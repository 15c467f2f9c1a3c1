"""The triangle mesh that the surface half of the kernel returns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Mesh:
    """An oriented triangle mesh.

    vertices: (n, 3) m, world; the network's points come first, in their order. faces: (m, 3) vertex indices,
    counter-clockwise seen from outside. normals: (n, 3) outward unit normals.
    mean_curvature: (n,) 1/m, mean of the principal curvatures, positive where the surface bends away from its outward
    normal (a sphere of radius r has 1/r). gaussian_curvature: (n,) 1/m^2, their product.
    patch: (m,) index of the cycle of the network that a face belongs to.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64]
    mean_curvature: NDArray[np.float64]
    gaussian_curvature: NDArray[np.float64]
    patch: NDArray[np.int64]
