"""Curves on a surface that is known exactly: position and Darboux frame at any arc length."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tracemesh.geometry.network import Floats, Ints
from tracemesh.geometry.rotations import normalized

SurfaceMap = Callable[[Floats], tuple[Floats, Floats]]
"""(n, d) points of the domain -> (n, 3) points in m and (n, 3, d) Jacobians, d = 2 or 3."""

_INTERVALS = 2000


@dataclass(frozen=True)
class Line:
    """A straight line of the domain from `start` to `end`, both (d,)."""

    start: Floats
    end: Floats

    def at(self, parameter: Floats) -> tuple[Floats, Floats]:
        """Points (n, d) and derivatives (n, d) at parameters (n,) from 0 to 1."""
        along = self.end - self.start
        return self.start + parameter[:, None] * along, np.broadcast_to(along, (len(parameter), len(along)))

    def parameter(self, point: Floats) -> float:
        """Parameter of the point of the line next to `point` (d,)."""
        along = self.end - self.start
        return float((point - self.start) @ along / (along @ along))


@dataclass(frozen=True)
class Circle:
    """A circle of the domain: centre (d,) and two orthogonal radius vectors (d,); it begins at the end of `first`."""

    centre: Floats
    first: Floats
    second: Floats

    def at(self, parameter: Floats) -> tuple[Floats, Floats]:
        """Points (n, d) and derivatives (n, d) at parameters (n,) from 0 to 1, once around."""
        angle = 2 * np.pi * parameter[:, None]
        cos, sin = np.cos(angle), np.sin(angle)
        return self.centre + cos * self.first + sin * self.second, 2 * np.pi * (cos * self.second - sin * self.first)

    def parameter(self, point: Floats) -> float:
        """Parameter, from 0 to less than 1, of the point of the circle next to `point` (d,)."""
        from_centre = point - self.centre
        turn = float(np.arctan2(from_centre @ self.second, from_centre @ self.first) / (2 * np.pi)) % 1.0
        return 0.0 if turn > 1 - 1e-9 else turn  # a node at the start, one rounding error before it

    def starting_at(self, point: Floats) -> "Circle":
        """The same circle, begun at the point of it next to `point` (d,)."""
        (first,), (along,) = self.at(np.array([self.parameter(point)]))
        return Circle(self.centre, first - self.centre, along / (2 * np.pi))


DomainCurve = Line | Circle


@dataclass(frozen=True)
class ShapeCurve:
    """A curve on a surface, with the nodes on it; a closed curve begins at its first node and repeats it last.

    path: where it runs in the domain of `surface`. node_parameters, node_ids: (m,) parameter and number of each node.
    """

    surface: SurfaceMap
    path: DomainCurve
    boundary: bool
    node_parameters: Floats
    node_ids: Ints

    @property
    def closed(self) -> bool:
        """Whether the curve ends where it began."""
        return isinstance(self.path, Circle)

    @property
    def length(self) -> float:
        """Arc length, m."""
        return float(self._arc_length[1][-1])

    @cached_property
    def node_positions(self) -> Floats:
        """Arc length of each node, (m,) m, increasing."""
        parameter, length = self._arc_length
        return _hermite(self.node_parameters, parameter, length, self._speed(parameter))

    def at(self, arc_length: Floats) -> tuple[Floats, Floats]:
        """Positions (n, 3) m and frames [t N B] (n, 3, 3) at arc lengths (n,) m; closed curves go round and round."""
        wrapped = np.mod(arc_length, self.length) if self.closed else np.clip(arc_length, 0.0, self.length)
        parameter, length, slowness = self._inverse
        domain, along = self.path.at(_hermite(wrapped, length, parameter, slowness))
        points, jacobians = self.surface(domain)
        tangent = np.einsum("nij,nj->ni", jacobians, along)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        normal = surface_normals(domain, jacobians)
        return points, np.stack([tangent, normal, np.cross(tangent, normal)], axis=2)

    def _speed(self, parameter: Floats) -> Floats:
        domain, along = self.path.at(parameter)
        speed: Floats = np.linalg.norm(np.einsum("nij,nj->ni", self.surface(domain)[1], along), axis=1)
        return speed

    @cached_property
    def _arc_length(self) -> tuple[Floats, Floats]:
        """Parameters of the table and the arc length up to each: Gauss-Legendre, four points an interval."""
        nodes, weights = np.polynomial.legendre.leggauss(4)
        ends = np.linspace(0.0, 1.0, _INTERVALS + 1)
        inner = (ends[:-1, None] + (nodes + 1) / (2 * _INTERVALS)).ravel()
        pieces = self._speed(inner).reshape(-1, 4) @ weights / (2 * _INTERVALS)
        return ends, np.concatenate([[0.0], np.cumsum(pieces)])

    @cached_property
    def _inverse(self) -> tuple[Floats, Floats, Floats]:
        """Parameter by arc length, and its derivative."""
        parameter, length = self._arc_length
        return parameter, length, 1 / self._speed(parameter)


def _hermite(x: Floats, knots: Floats, values: Floats, slopes: Floats) -> Floats:
    """Cubic Hermite interpolation at x (n,) between increasing knots (k,)."""
    k = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    width = knots[k + 1] - knots[k]
    t = (x - knots[k]) / width
    ends = (1 + 2 * t) * (1 - t) ** 2 * values[k] + t**2 * (3 - 2 * t) * values[k + 1]
    result: Floats = ends + width * t * (1 - t) * ((1 - t) * slopes[k] - t * slopes[k + 1])
    return result


def surface_normals(domain: Floats, jacobians: Floats) -> Floats:
    """Outward unit normals (n, 3) of a mapped disk (d = 2) or a mapped unit sphere (d = 3)."""
    if domain.shape[1] == 2:
        return normalized(np.cross(jacobians[:, :, 0], jacobians[:, :, 1]))
    # a sphere's normal is its own point, carried over by the cofactors of the Jacobian
    carried = np.linalg.solve(jacobians.transpose(0, 2, 1), domain[:, :, None])[:, :, 0]
    return normalized(np.asarray(carried, np.float64))
