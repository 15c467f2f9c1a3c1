"""Products of many short vectors: for arrays (..., 3) two to four times quicker than sums along an axis."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def dot(a: Floats, b: Floats) -> Floats:
    """(...) products of vectors (..., d), broadcast."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def lengths(vector: Floats) -> Floats:
    """Euclidean lengths (...) of vectors (..., d)."""
    return np.asarray(np.sqrt(dot(vector, vector)))


def corner_sum(values: Floats) -> Floats:
    """(f, d) sums over the corners of triangles, (f, 3, d)."""
    return np.asarray(values[:, 0] + values[:, 1] + values[:, 2])
