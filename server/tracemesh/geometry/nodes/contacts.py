"""Places where two floating curves touch, and the poses and places that fit all of them best."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tracemesh.geometry.network import Floats
from tracemesh.geometry.nodes.floating import FloatingCurve, Pose

HEADING = float(np.radians(2.0))
"""rad, standard deviation of a curve's heading error."""
DRIFT = 0.006
"""m per m, standard deviation of the way between two places of a curve."""
POSITION = 0.004
"""m, standard deviation of a place of a curve in the joint solution."""
NORMAL = float(np.radians(1.5))
"""rad, standard deviation of a smoothed normal."""
_KNOWN = 0.001
"""m, standard deviation of a place that is known: an end of an open curve, a marked sample."""
_CAUTION = 0.5
"""Standard deviation of places over the one that those above make: they leave room for what is not modelled."""
_LARGEST_STEP = 0.02
_SETTLED = 1e-5
_ROUNDS = 30
_DAMPING = 1e-6


@dataclass(frozen=True)
class Contact:
    """Curve a at arc length s touches curve b at arc length t (m).

    confidence: 0 to 1. known_s, known_t: the place is known beforehand. node: its number, if it was marked. spread: m,
    standard deviation of its place in the joint solution, on the curve where it is larger.
    """

    a: int
    s: float
    b: int
    t: float
    confidence: float
    known_s: bool = False
    known_t: bool = False
    node: int | None = None
    spread: float = 0.0


@dataclass(frozen=True)
class Settled:
    """poses: of the curves that were placed, by index. contacts: in their best places. misfit: (m,) how many standard
    deviations each is off, squared and summed over position and normal (5 degrees of freedom).
    """

    poses: dict[int, Pose]
    contacts: tuple[Contact, ...]
    misfit: Floats


def settle(curves: Sequence[FloatingCurve], poses: dict[int, Pose], contacts: Sequence[Contact]) -> Settled:
    """Best poses of placed curves and places of contacts between them; the first placed curve stays where it is.

    Gauss-Newton on the distances and the angles between normals at all contacts, with headings and known places held by
    their standard deviations.
    """
    placed, system = list(poses), _System(curves, list(poses), contacts, next(iter(poses.values())).shift)
    unknowns = np.concatenate(
        [*([p.turn, *p.shift] for p in poses.values()), [x for c in contacts for x in (c.s, c.t)]]
    )
    for _ in range(_ROUNDS):
        residual, jacobian = system.linearised(unknowns)
        hessian = jacobian.T @ jacobian
        step = np.linalg.solve(hessian + _DAMPING * np.diag(np.diag(hessian)), -jacobian.T @ residual)
        step *= min(1.0, _LARGEST_STEP / max(float(np.abs(step).max()), 1e-300))
        before, unknowns = unknowns, system.clipped(unknowns + step)
        if np.abs(unknowns - before).max() < _SETTLED:
            break
    residual = system.linearised(unknowns)[0][: 6 * len(contacts)]
    turns, places = unknowns[: 4 * len(placed)].reshape(-1, 4), unknowns[4 * len(placed) :].reshape(-1, 2)
    variances = np.diag(np.linalg.inv(hessian + _DAMPING * np.diag(np.diag(hessian))))[4 * len(placed) :]
    spread = _CAUTION * np.sqrt(variances).reshape(-1, 2).max(axis=1)
    return Settled(
        {index: Pose(float(row[0]), row[1:].copy()) for index, row in zip(placed, turns, strict=True)},
        tuple(
            replace(c, s=float(s), t=float(t), spread=float(d))
            for c, (s, t), d in zip(contacts, places, spread, strict=True)
        ),
        np.sum(residual.reshape(-1, 6) ** 2, axis=1),
    )


class _System:
    """Residuals and their derivatives. Unknowns: per placed curve a turn and a shift, per contact two arc lengths."""

    def __init__(
        self, curves: Sequence[FloatingCurve], placed: Sequence[int], contacts: Sequence[Contact], origin: Floats
    ) -> None:
        self._curves, self._placed, self._contacts, self._origin = curves, placed, contacts, origin
        self._first = np.array([c.s for c in contacts]), np.array([c.t for c in contacts])
        self._known = [(k, side) for k, c in enumerate(contacts) for side in (0, 1) if (c.known_s, c.known_t)[side]]

    def linearised(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Residuals (r,) in standard deviations and their Jacobian (r, u)."""
        count = len(self._contacts)
        blocks = np.zeros((count, 6, len(unknowns)))
        offset = np.zeros((count, 6))
        for k, contact in enumerate(self._contacts):
            for side, curve in ((0, contact.a), (1, contact.b)):
                self._add(offset[k], blocks[k], unknowns, k, side, curve)
        held, derivative = self._held(unknowns)
        return np.concatenate([offset.ravel(), held]), np.concatenate([blocks.reshape(-1, len(unknowns)), derivative])

    def clipped(self, unknowns: Floats) -> Floats:
        """Arc lengths brought back onto their curves."""
        result = unknowns.copy()
        for k, contact in enumerate(self._contacts):
            for side, index in ((0, contact.a), (1, contact.b)):
                at, curve = self._arc(k, side), self._curves[index]
                result[at] = result[at] % curve.length if curve.closed else np.clip(result[at], 0.0, curve.length)
        return result

    def _arc(self, contact: int, side: int) -> int:
        return 4 * len(self._placed) + 2 * contact + side

    def _add(self, offset: Floats, block: Floats, unknowns: Floats, k: int, side: int, index: int) -> None:
        """One side of a contact: its place and normal, with opposite signs on the two sides."""
        row, at, sign = 4 * self._placed.index(index), self._arc(k, side), 1 - 2 * side
        curve, rotation = self._curves[index], Pose(float(unknowns[row]), unknowns[row + 1 : row + 4]).rotation
        arc = float(unknowns[at])
        for part, spline, scale in ((slice(3), curve.position, POSITION), (slice(3, 6), curve.normal, NORMAL)):
            value, slope = rotation @ spline(arc), rotation @ spline(arc, 1)
            offset[part] += sign * value / scale
            block[part, row] += sign * np.array([-value[1], value[0], 0.0]) / scale
            block[part, at] += sign * slope / scale
        offset[:3] += sign * unknowns[row + 1 : row + 4] / POSITION
        block[:3, row + 1 : row + 4] += sign * np.eye(3) / POSITION

    def _held(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Headings, the first curve's place, and known places."""
        count = len(self._placed)
        residual = np.zeros(count + 3 + len(self._known))
        jacobian = np.zeros((len(residual), len(unknowns)))
        residual[:count] = unknowns[: 4 * count : 4] / HEADING
        jacobian[np.arange(count), 4 * np.arange(count)] = 1 / HEADING
        residual[count : count + 3] = (unknowns[1:4] - self._origin) / _KNOWN
        jacobian[count + np.arange(3), 1 + np.arange(3)] = 1 / _KNOWN
        for row, (k, side) in enumerate(self._known, count + 3):
            curve = self._curves[(self._contacts[k].a, self._contacts[k].b)[side]]
            residual[row] = curve.apart(unknowns[self._arc(k, side)], self._first[side][k]) / _KNOWN
            jacobian[row, self._arc(k, side)] = 1 / _KNOWN
        return residual, jacobian
