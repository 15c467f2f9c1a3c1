"""Rotations that the lengths of vectors leave open.

Of the magnetometer against the accelerometer, and of both against the case.
"""

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.rotations import exp, normalized
from tracemesh.geometry.scan import Floats
from tracemesh.geometry.sensing.calibration_ellipsoid import GATE
from tracemesh.geometry.sensing.orientation import angles_between

STEEPEST = np.radians(80.0)
"""A field steeper than this tells too little of a rotation about itself."""
STILL = np.radians(3.0)
"""How far a vector may be from the mean of a device that lies still."""
TILTED = np.radians(20.0)
"""How far from one of its axes a device that lies on a face may be."""
LEAST_POSE = 20
"""Readings in one pose."""


def alignment(acceleration: Floats, magnetic: Floats) -> Floats:
    """Rotation R (3, 3) of the magnetometer's axes into the accelerometer's: makes the dip the same in all poses.

    acceleration, magnetic: (n, 3), corrected, any unit. Up and the field enclose one angle, however the device is held:
    a^T R m is constant. Solved for any matrix first, whose nearest rotation is then made exact. Raises ScanError where
    the field is so steep that it tells nothing.
    """
    a, m = normalized(acceleration), normalized(magnetic)
    used = np.ones(len(a), bool)
    for _ in range(3):
        rotation, sine = _constant_angle(a[used], m[used])
        residual = np.sum(a * (m @ rotation.T), axis=1) - sine
        believed = np.abs(residual) <= max(GATE * 1.4826 * float(np.median(np.abs(residual))), 1e-9)
        if (believed == used).all():
            break
        used = believed
    if abs(sine) > np.sin(STEEPEST):
        raise ScanError(
            f"the field is {np.degrees(np.arcsin(min(1.0, abs(sine)))):.0f} degrees from horizontal, wanted at most "
            f"{np.degrees(STEEPEST):.0f}: so steep a field does not tell how the magnetometer is turned"
        )
    return rotation


def _constant_angle(a: Floats, m: Floats) -> tuple[Floats, float]:
    """R (3, 3) and c that minimise the sum of (a^T R m - c)^2."""
    from scipy.optimize import least_squares  # here: who only applies a calibration stays small without it

    products = (a[:, :, None] * m[:, None, :]).reshape(len(a), 9)
    loose = np.linalg.svd(np.column_stack([products, -np.ones(len(a))]), full_matrices=False)[2][-1][:9].reshape(3, 3)
    u, _, v = np.linalg.svd(loose * np.sign(np.linalg.det(loose)))
    start = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v

    def residual(turn: Floats) -> Floats:
        cosine = np.sum(a * (m @ (start @ exp(turn)).T), axis=1)
        result: Floats = cosine - cosine.mean()
        return result

    found = start @ exp(least_squares(residual, np.zeros(3), method="lm", xtol=1e-15).x)
    return found, float(np.mean(np.sum(a * (m @ found.T), axis=1)))


def at_rest(acceleration: Floats) -> Floats | None:
    """Mean (3,) of the accelerations (n, 3) of a device that did not move meanwhile, None if it did.

    One reading in ten may be pure chance.
    """
    if len(acceleration) < LEAST_POSE or not acceleration.any(axis=1).all():
        return None
    middle = np.median(acceleration, axis=0)
    if not middle.any():
        return None
    off = angles_between(acceleration, middle)
    near = acceleration[off <= STILL]
    early, late = (np.median(half, axis=0) for half in np.array_split(acceleration, 2))
    still = len(near) >= 0.9 * len(off) and angles_between(early, late) <= STILL / 3
    return near.mean(axis=0) if still else None


def face_rotation(up: Floats) -> Floats:
    """Rotation (3, 3) of the accelerometer's axes into those of the case, from poses in which it lay on its faces.

    up: (k, 3) directions that the accelerometer measured, one for each pose; each is nearly one of its axes. Raises
    ScanError where one is not, or where they are all along one axis.
    """
    along = np.abs(up).argmax(axis=1) if len(up) else np.empty(0, int)
    if len(set(along.tolist())) < 2:
        raise ScanError("wanted the device at rest on faces that are not all opposite ones; lay it on six, one by one")
    faces = np.eye(3)[along] * np.sign(np.take_along_axis(up, along[:, None], axis=1))
    off = angles_between(up, faces)
    if off.max() > TILTED:
        raise ScanError(
            f"pose {int(off.argmax()) + 1} is {np.degrees(off.max()):.0f} degrees away from all faces of the device, "
            f"wanted at most {np.degrees(TILTED):.0f}"
        )
    u, _, v = np.linalg.svd(faces.T @ up)
    result: Floats = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return result
