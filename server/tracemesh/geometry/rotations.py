"""Rotations as matrices, vectors and quaternions (w, x, y, z), vectorised over leading axes."""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.vectors import lengths

Floats = NDArray[np.float64]

_SMALL = 1e-4  # rad; below it the Taylor series of the coefficients is exact to rounding


def hat(vector: Floats) -> Floats:
    """Cross-product matrices (..., 3, 3) of vectors (..., 3)."""
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = (vector[..., i] for i in range(3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix


def skew_vector(matrix: Floats) -> Floats:
    """Vectors (..., 3) with hat(v) = M - M^T for matrices (..., 3, 3)."""
    columns = (
        matrix[..., 2, 1] - matrix[..., 1, 2],
        matrix[..., 0, 2] - matrix[..., 2, 0],
        matrix[..., 1, 0] - matrix[..., 0, 1],
    )
    return np.stack(columns, axis=-1)


def exp(vector: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad."""
    half = lengths(vector)[..., None] / 2
    return quaternion_to_matrix(np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector], axis=-1))


def log(matrix: Floats) -> Floats:
    """Rotation vectors (..., 3), rad, |v| <= pi, of rotation matrices (..., 3, 3)."""
    q = matrix_to_quaternion(matrix)
    q = np.where(q[..., :1] < 0, -q, q)
    sine = lengths(q[..., 1:])
    half = np.arctan2(sine, q[..., 0])
    factor = np.where(sine < _SMALL, 2 / np.maximum(q[..., 0], 0.5), 2 * half / np.maximum(sine, _SMALL))
    result: Floats = factor[..., None] * q[..., 1:]
    return result


def quaternion_to_matrix(quaternion: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4), w first."""
    w, x, y, z = (quaternion[..., i] for i in range(4))
    matrix = np.empty((*quaternion.shape[:-1], 3, 3))
    matrix[..., 0, 0] = 1 - 2 * (y * y + z * z)
    matrix[..., 1, 1] = 1 - 2 * (x * x + z * z)
    matrix[..., 2, 2] = 1 - 2 * (x * x + y * y)
    matrix[..., 0, 1], matrix[..., 1, 0] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    matrix[..., 0, 2], matrix[..., 2, 0] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    matrix[..., 1, 2], matrix[..., 2, 1] = 2 * (y * z - w * x), 2 * (y * z + w * x)
    return matrix


def matrix_to_quaternion(matrix: Floats) -> Floats:
    """Unit quaternions (..., 4), w first, of rotation matrices (..., 3, 3); the sign is arbitrary.

    The largest of the four components is computed first, so that none is divided by a small number.
    """
    x, y, z = (matrix[..., i, i] for i in range(3))
    outer = np.empty((4, 4, *matrix.shape[:-2]))  # 4 q_i q_j
    outer[0, 0], outer[1, 1], outer[2, 2], outer[3, 3] = 1 + x + y + z, 1 + x - y - z, 1 - x + y - z, 1 - x - y + z
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        outer[0, k + 1] = outer[k + 1, 0] = matrix[..., j, i] - matrix[..., i, j]
        outer[i + 1, j + 1] = outer[j + 1, i + 1] = matrix[..., i, j] + matrix[..., j, i]
    largest = np.stack([outer[i, i] for i in range(4)]).argmax(axis=0)
    row = np.take_along_axis(outer, largest[None, None], axis=0)[0]
    return normalized(np.ascontiguousarray(np.moveaxis(row, 0, -1)))


def align_signs(quaternion: Floats) -> Floats:
    """The same rotations (n, 4) with signs chosen so that consecutive quaternions have a dot product >= 0."""
    if len(quaternion) < 2:
        return quaternion
    flips = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0
    sign = np.concatenate([[1.0], np.where(np.cumsum(flips) % 2, -1.0, 1.0)])
    result: Floats = quaternion * sign[:, None]
    return result


def normalized(vector: Floats) -> Floats:
    """Unit vectors (..., n) along vectors (..., n) that are not zero."""
    result: Floats = vector / lengths(vector)[..., None]
    return result


def darboux_frames(tangent: Floats, normal: Floats) -> Floats:
    """Frames [t N B] (n, 3, 3) with the given unit normals N (n, 3) and t the tangent (n, 3) made orthogonal to them.

    The normal is kept because a device's tangent may be the chord to its next sample, which leaves the tangent plane.
    """
    n = normalized(normal)
    t = normalized(tangent - np.einsum("...i,...i->...", tangent, n)[..., None] * n)
    return np.stack([t, n, np.cross(t, n)], axis=-1)


def quaternion_difference(to: Floats, origin: Floats) -> Floats:
    """Rotation vectors (..., 3), rad, of to origin^-1, of unit quaternions (..., 4) less than half a turn apart."""
    w = np.einsum("...i,...i->...", to, origin)[..., None]
    u, v = to[..., 1:], origin[..., 1:]
    vector = origin[..., :1] * u - to[..., :1] * v - np.cross(u, v)
    vector = np.where(w < 0, -vector, vector)
    sine = lengths(vector)[..., None]
    angle = 2 * np.arctan2(sine, np.abs(w))
    result: Floats = np.where(sine < _SMALL, 2.0, angle / np.maximum(sine, _SMALL)) * vector
    return result


def quaternion_product(first: Floats, second: Floats) -> Floats:
    """Quaternions (..., 4), w first, of the rotation by `second` followed by that by `first`."""
    w, v, u, r = first[..., :1], first[..., 1:], second[..., :1], second[..., 1:]
    scalar = w * u - np.sum(v * r, axis=-1, keepdims=True)
    result: Floats = np.concatenate([scalar, w * r + u * v + np.cross(v, r)], axis=-1)
    return result
