"""Registration of points to a mesh: the rotation, translation and scale with the least sum of squared distances.

Iterated closest points; each step is Levenberg-Marquardt with the exact gradient of the sum and the curvature of the
distance to the tangent plane (inside the mesh), to the edge (at its rim) or to the corner, so that it ends in a true
minimum and converges fast on smooth surfaces, where the usual point-to-point step (Besl and McKay 1992) creeps along.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tracemesh.geometry.comparison.closest import ClosestPoints
from tracemesh.geometry.network import Floats, Ints

_TRIAL_STEPS = 25
_TRIAL_POINTS = 500
_STEPS = 200
_SETTLED = 1e-9
_GOOD = 0.002
"""Misfit with which the start in the same orientation is taken for the right one."""
_CLEARLY = 0.5
"""Part of its misfit that another start must come under: on a symmetric shape all of them are about as good."""


@dataclass(frozen=True)
class Placement:
    """x -> scale rotation x + translation; rotation (3, 3), translation (3,) m."""

    rotation: Floats
    translation: Floats
    scale: float = 1.0

    def apply(self, points: Floats) -> Floats:
        """Placed points (n, 3)."""
        result: Floats = self.scale * points @ self.rotation.T + self.translation
        return result


def register(
    points: Floats,
    vertices: Floats,
    faces: Ints,
    scaled: bool = False,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Placement:
    """Best placement of points (n, 3) on a mesh, without or with a scale.

    Begins with the same orientation; when that does not fit well, also with the principal axes matched in all ways, and
    returns the best. With a scale, distances are counted in the points' own unit: otherwise the best scale were zero.
    `progress` hears the fraction done, which jumps ahead when fewer steps are enough.
    """
    target = _Target(vertices, faces)
    rotations = [np.eye(3), *_axis_matches(points, vertices)]
    some = points[:: -(-len(points) // _TRIAL_POINTS)]
    best, least = Placement(np.eye(3), np.zeros(3)), np.inf
    for trial, rotation in enumerate(rotations):
        progress(trial / (2 * len(rotations)))
        placement, misfit = _descend(some, _start(points, vertices, rotation, scaled), target, scaled, _TRIAL_STEPS)
        if misfit < _CLEARLY * least:
            best, least = placement, misfit
        if least < _GOOD:
            break
    return _descend(points, best, target, scaled, _STEPS, lambda part: progress((1 + part) / 2))[0]


class _Target:
    """The mesh, with what the steps need to know of it."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        self.closest = ClosestPoints(vertices, faces)
        corners = self.closest.corners
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        self.rim = _rim(faces)
        self.diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))

    def offsets(self, points: Floats) -> tuple[Floats, Floats]:
        """From the closest points to the points (n, 3), and matrices (n, 3, 3): in which directions distance grows."""
        weights, _, face = self.closest(points)
        stiffness = np.einsum("ni,nj->nij", self.normals[face], self.normals[face])
        on_rim = (weights == 0) & self.rim[face]
        corners = self.closest.corners[face]
        for opposite in range(3):
            at = on_rim[:, opposite]
            edge = corners[at, opposite - 1] - corners[at, opposite - 2]
            edge /= np.linalg.norm(edge, axis=1, keepdims=True)
            stiffness[at] = np.eye(3) - np.einsum("ni,nj->nij", edge, edge)
        stiffness[on_rim.sum(axis=1) > 1] = np.eye(3)
        return points - self.closest.at(weights, face), stiffness


def _rim(faces: Ints) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Whether the edge opposite to corner k of a face belongs to no other face, (m, 3)."""
    edges = np.sort(np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], axis=1).reshape(-1, 2), axis=1)
    _, inverse, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    result: np.ndarray[tuple[int, int], np.dtype[np.bool_]] = (counts[inverse.ravel()] == 1).reshape(-1, 3)
    return result


def _start(points: Floats, vertices: Floats, rotation: Floats, scaled: bool) -> Placement:
    centre, goal = points.mean(axis=0), vertices.mean(axis=0)
    scale = float(np.linalg.norm(np.ptp(vertices, axis=0)) / np.linalg.norm(np.ptp(points @ rotation.T, axis=0)))
    scale = scale if scaled else 1.0
    return Placement(rotation, goal - scale * rotation @ centre, scale)


def _axis_matches(points: Floats, vertices: Floats) -> list[Floats]:
    """The four rotations that take principal axes to principal axes."""
    one, two = (np.linalg.eigh(np.cov(p.T))[1] for p in (points, vertices))
    rotations = []
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        turned = one * (*signs, 1)
        rotation = two @ turned.T
        rotations.append(rotation if np.linalg.det(rotation) > 0 else two @ (turned * (1, 1, -1)).T)
    return rotations


def _descend(
    points: Floats,
    start: Placement,
    target: _Target,
    scaled: bool,
    steps: int,
    progress: Callable[[float], None] = lambda fraction: None,
) -> tuple[Placement, float]:
    """Where at most so many steps lead from a start, and the misfit there: rms distance over the points' extent."""
    here, damping = _Fit.of(points, start, target), 1e-6
    for taken in range(steps):
        progress(taken / steps)
        gradient, hessian, size = _normal_equations(here, scaled)
        damped = hessian + damping * len(points) * np.eye(len(gradient))
        step = np.linalg.solve(damped, -gradient).astype(np.float64)
        there = _Fit.of(points, _moved(here.placement, step, here.placed.mean(axis=0), size), target)
        if there.cost < here.cost:
            settled = here.cost - there.cost <= _SETTLED * here.cost
            here, damping = there, max(damping / 10, 1e-12)
            if settled:
                break
        elif damping > 1e4:
            break
        else:
            damping = 10 * max(damping, 1e-6)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    return here.placement, float(np.sqrt(here.cost / len(points))) / max(extent, 1e-300)


@dataclass(frozen=True)
class _Fit:
    """A placement and how well it fits. cost: sum of squared distances in the points' own unit."""

    placement: Placement
    placed: Floats
    offset: Floats
    stiffness: Floats
    cost: float

    @staticmethod
    def of(points: Floats, placement: Placement, target: _Target) -> "_Fit":
        placed = placement.apply(points)
        offset, stiffness = target.offsets(placed)
        return _Fit(placement, placed, offset, stiffness, float(np.sum(offset**2)) / placement.scale**2)


def _normal_equations(fit: _Fit, scaled: bool) -> tuple[Floats, Floats, float]:
    """Gradient and Hessian by rotation, translation and logarithm of scale; and their unit of length, m."""
    arm = fit.placed - fit.placed.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum(arm**2, axis=1)))) or 1.0
    arm, offset = arm / size, fit.offset / size
    jacobian = np.zeros((len(arm), 3, 7 if scaled else 6))
    jacobian[:, :, :3] = np.cross(np.eye(3)[None], arm[:, None, :]).transpose(0, 2, 1)
    jacobian[:, :, 3:6] = np.eye(3)
    if scaled:
        jacobian[:, :, 6] = arm
    hessian = np.einsum("nij,nik->jk", jacobian, np.einsum("nij,njk->nik", fit.stiffness, jacobian))
    gradient = np.einsum("nij,ni->j", jacobian, offset)
    if scaled:  # the unit in which distances are counted grows, too
        gradient[6] -= np.sum(offset**2)
    return gradient, hessian, size


def _moved(placement: Placement, step: Floats, centre: Floats, size: float) -> Placement:
    """Turned about the centre, shifted, and scaled."""
    turn = Rotation.from_rotvec(step[:3]).as_matrix()
    grow = float(np.exp(step[6])) if len(step) > 6 else 1.0
    translation = grow * turn @ (placement.translation - centre) + centre + size * step[3:6]
    return Placement(turn @ placement.rotation, translation, grow * placement.scale)
