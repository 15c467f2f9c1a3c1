"""Built-in shapes whose surface is known exactly, each with a network of curves on it; sizes of real objects.

A shape is a smooth map from a simple domain (the unit disk, or the unit sphere for closed shapes) into space, with its
Jacobian; its curves are lines and circles of the domain that meet in numbered nodes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations, pairwise, product

import numpy as np

from tracemesh.geometry.network import CurveNetwork, Floats, Ints, Segment
from tracemesh.geometry.simulated.shape_curves import Circle, DomainCurve, Line, ShapeCurve, SurfaceMap

_ON_CURVE = 1e-9


@dataclass(frozen=True)
class Shape:
    """A known surface and the curves that are scanned on it.

    surface: map from the domain, (n, d) points with d = 2 (unit disk) or 3 (unit sphere), to points (n, 3) in m and
    Jacobians (n, 3, d). curves: in the order of scanning, the boundary first. closed: a surface without boundary.
    """

    name: str
    surface: SurfaceMap
    curves: tuple[ShapeCurve, ...]
    closed: bool

    def mesh(self, resolution: int = 64) -> tuple[Floats, Ints]:
        """Vertices (n, 3) m, exactly on the surface, and outward faces (m, 3); about 3 to 4 resolution^2 vertices."""
        points, faces = _sphere_mesh(resolution) if self.closed else _disk_mesh(resolution)
        return self.surface(points)[0], faces

    def network(self, step: float) -> CurveNetwork:
        """The exact network, every segment sampled uniformly by arc length with spacing of about `step` m."""
        return _network(self.curves, step)


def leaf() -> Shape:
    """A leaf 0.8 m long: cupped along its midrib, arched, its edge gently waved."""
    return Shape("leaf", _leaf, _disk_curves(_leaf, xs=(-0.5, 0.05, 0.55), ys=(0.0,)), closed=False)


def sphere() -> Shape:
    """A patch of a sphere of radius 0.5 m, about 1.4 rad across."""
    surface = partial(_revolved, profile=_sphere_profile, extent=(0.75, 0.65))
    return Shape("sphere", surface, _disk_curves(surface, xs=(-0.35, 0.4), ys=(-0.3, 0.35)), closed=False)


def torus() -> Shape:
    """A patch of the outer side of a torus (R = 0.5 m, r = 0.25 m): curvature of both signs."""
    surface = partial(_revolved, profile=_torus_profile, extent=(0.6, 1.2))
    return Shape("torus", surface, _disk_curves(surface, xs=(-0.4, 0.35), ys=(-0.35, 0.4)), closed=False)


def cone() -> Shape:
    """A patch of a cone of half angle 0.25 rad, 0.6 m high: developable, curved in one direction only."""
    surface = partial(_revolved, profile=_cone_profile, extent=(1.1, 0.3))
    return Shape("cone", surface, _disk_curves(surface, xs=(-0.4, 0.4), ys=(0.1,), rings=(0.75,)), closed=False)


def egg() -> Shape:
    """A whole egg 0.5 m high, scanned along closed curves only."""
    sections = ((2, 0.0), (0, 0.0), (1, 0.0), (2, 0.6))
    return Shape("egg", _egg, _sphere_curves(_egg, sections), closed=True)


SHAPES: dict[str, Callable[[], Shape]] = {f.__name__: f for f in (leaf, sphere, torus, cone, egg)}


def _leaf(points: Floats) -> tuple[Floats, Floats]:
    x, y = points.T
    width = 0.23 * (1 - 0.32 * x)
    across = np.column_stack([np.full_like(x, 0.4), np.zeros_like(x)])
    side = np.column_stack([-0.23 * 0.32 * y - 0.1 * x, width])
    wave, lift = 0.02 * np.sin(4 * x + 0.5), 0.09 - 0.03 * x
    up = np.column_stack([-0.22 * x + 0.08 * y * np.cos(4 * x + 0.5) - 0.03 * y**2, wave + 2 * lift * y])
    position = np.column_stack([0.4 * x, width * y - 0.05 * x**2, -0.11 * x**2 + wave * y + lift * y**2])
    return position, np.stack([across, side, up], axis=1)


def _egg(points: Floats) -> tuple[Floats, Floats]:
    x, y, z = points.T
    width, zero = 0.19 * (1 - 0.22 * z), np.zeros_like(x)
    jacobian = np.array([[width, zero, -0.19 * 0.22 * x], [zero, width, -0.19 * 0.22 * y], [zero, zero, zero + 0.25]])
    return np.column_stack([width * x, width * y, 0.25 * z]), np.moveaxis(jacobian, 2, 0)


Profile = Callable[[Floats], tuple[Floats, Floats, Floats, Floats]]
"""Radius and height of a surface of revolution, m, and the derivatives of both, at a parameter that runs upwards."""


def _revolved(points: Floats, profile: Profile, extent: tuple[float, float]) -> tuple[Floats, Floats]:
    """Surface of revolution about z over angles +-extent[0] and profile parameters +-extent[1]."""
    angle, parameter = (points * extent).T
    cos, sin = np.cos(angle), np.sin(angle)
    radius, height, radius_rate, height_rate = profile(parameter)
    around = np.column_stack([-radius * sin, radius * cos, np.zeros_like(angle)]) * extent[0]
    upwards = np.column_stack([radius_rate * cos, radius_rate * sin, height_rate]) * extent[1]
    return np.column_stack([radius * cos, radius * sin, height]), np.stack([around, upwards], axis=2)


def _sphere_profile(latitude: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    cos, sin = 0.5 * np.cos(latitude), 0.5 * np.sin(latitude)
    return cos, sin, -sin, cos


def _torus_profile(latitude: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    cos, sin = 0.25 * np.cos(latitude), 0.25 * np.sin(latitude)
    return 0.5 + cos, sin, -sin, cos


def _cone_profile(along: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    one = np.ones_like(along)
    narrowing, rise = -np.sin(0.25) * one, np.cos(0.25) * one
    return 0.35 + narrowing * along, rise * along, narrowing, rise


def _disk_curves(
    surface: SurfaceMap, xs: Sequence[float], ys: Sequence[float], rings: Sequence[float] = ()
) -> tuple[ShapeCurve, ...]:
    """The rim of the unit disk, chords at these x and y, and rings of these radii."""
    circles = [Circle(np.zeros(2), np.array([r, 0.0]), np.array([0.0, r])) for r in (1.0, *rings)]
    chords = [_chord(0, x) for x in xs] + [_chord(1, y) for y in ys]
    nodes = [np.array([x, y]) for x in xs for y in ys]
    for radius in (1.0, *rings):
        nodes += [np.array([x, s * np.sqrt(radius**2 - x**2)]) for x in xs for s in (-1, 1) if abs(x) < radius]
        nodes += [np.array([s * np.sqrt(radius**2 - y**2), y]) for y in ys for s in (-1, 1) if abs(y) < radius]
    return _numbered(surface, [*circles, *chords], nodes, boundaries=1)


def _chord(axis: int, value: float) -> Line:
    half = np.sqrt(1 - value**2)
    ends = np.array([[value, -half], [value, half]])
    return Line(*(ends if axis == 0 else ends[:, ::-1].copy()))


def _sphere_curves(surface: SurfaceMap, sections: Sequence[tuple[int, float]]) -> tuple[ShapeCurve, ...]:
    """Circles that planes (axis, value) cut out of the unit sphere."""
    unit = np.eye(3)
    circles: list[DomainCurve] = []
    for axis, value in sections:
        radius = np.sqrt(1 - value**2)
        circles.append(Circle(value * unit[axis], radius * unit[axis - 2], radius * unit[axis - 1]))
    nodes = []
    for (i, a), (j, b) in combinations(sections, 2):
        if i != j and (height := 1 - a**2 - b**2) > 0:
            nodes += [a * unit[i] + b * unit[j] + s * np.sqrt(height) * unit[3 - i - j] for s in (-1, 1)]
    return _numbered(surface, circles, nodes, boundaries=0)


def _numbered(
    surface: SurfaceMap, paths: Sequence[DomainCurve], nodes: Sequence[Floats], boundaries: int
) -> tuple[ShapeCurve, ...]:
    """Curves with the nodes on them, numbered as they are met; the first `boundaries` curves bound the surface."""
    distinct = [p for k, p in enumerate(nodes) if all(np.linalg.norm(p - q) > _ON_CURVE for q in nodes[:k])]
    numbers: dict[int, int] = {}
    curves = []
    for index, path in enumerate(paths):
        met = [k for k, point in enumerate(distinct) if _lies_on(path, point)]
        if isinstance(path, Circle):
            path = path.starting_at(distinct[met[0]])
        order = sorted((path.parameter(distinct[k]), k) for k in met)
        if isinstance(path, Circle):
            order.append((1.0, order[0][1]))
        ids = [numbers.setdefault(k, len(numbers)) for _, k in order]
        parameters = np.array([parameter for parameter, _ in order])
        curves.append(ShapeCurve(surface, path, index < boundaries, parameters, np.array(ids, np.int64)))
    return tuple(curves)


def _lies_on(path: DomainCurve, point: Floats) -> bool:
    nearest = path.at(np.array([path.parameter(point)]))[0][0]
    return bool(np.linalg.norm(nearest - point) < _ON_CURVE)


def _network(curves: Sequence[ShapeCurve], step: float) -> CurveNetwork:
    """Nodes first, then the inner points of every segment."""
    count = 1 + max(int(c.node_ids.max()) for c in curves)
    rows = np.empty((count, 2, 3))
    blocks, segments, total = [rows], [], count
    for index, curve in enumerate(curves):
        rows[curve.node_ids] = _points_and_normals(curve, curve.node_positions)
        for ends, (a, b) in zip(pairwise(curve.node_ids), pairwise(curve.node_positions), strict=True):
            inner = np.linspace(a, b, max(2, round((b - a) / step) + 1))[1:-1]
            blocks.append(_points_and_normals(curve, inner))
            indices = [ends[0], *range(total, total + len(inner)), ends[1]]
            segments.append(Segment(np.array(indices, np.int64), curve.boundary, index))
            total += len(inner)
    points, normals = np.moveaxis(np.concatenate(blocks), 1, 0)
    return CurveNetwork(points.copy(), normals.copy(), np.arange(count), tuple(segments))


def _points_and_normals(curve: ShapeCurve, arc_length: Floats) -> Floats:
    points, frames = curve.at(arc_length)
    return np.stack([points, frames[:, :, 1]], axis=1)


def _disk_mesh(resolution: int) -> tuple[Floats, Ints]:
    """Rings of 6, 12, 18, ... points around the centre of the unit disk, joined by triangles of about one size."""
    points: list[Floats] = [np.zeros((1, 2))]
    faces: list[Ints] = []
    inner, start = np.zeros(1, np.int64), 1
    for ring in range(1, resolution + 1):
        k = np.arange(6 * ring)
        angle, outer = k * (np.pi / (3 * ring)), start + k
        points.append(ring / resolution * np.column_stack([np.cos(angle), np.sin(angle)]))
        below = k - k // ring  # the inner ring has one point less in each of the six sectors
        low, before = inner[below % len(inner)], inner[(below - 1) % len(inner)]
        faces.append(np.column_stack([low, outer, np.roll(outer, -1)]))
        faces.append(np.column_stack([before, outer, low])[k % ring > 0])
        inner, start = outer, start + 6 * ring
    return np.concatenate(points), np.concatenate(faces)


def _sphere_mesh(resolution: int) -> tuple[Floats, Ints]:
    """The octahedron's faces cut into resolution^2 triangles each, blown up to the unit sphere."""
    corners, triangles = _triangle_grid(resolution)
    octants = np.array(list(product((1, -1), repeat=3)))
    points = np.concatenate([corners * signs for signs in octants])
    faces = [
        (triangles if signs.prod() > 0 else triangles[:, ::-1]) + k * len(corners) for k, signs in enumerate(octants)
    ]
    lattice, merged = np.unique(points, axis=0, return_inverse=True)
    unit = lattice / np.linalg.norm(lattice, axis=1, keepdims=True)
    return unit, merged.reshape(-1)[np.concatenate(faces)]


def _triangle_grid(resolution: int) -> tuple[Ints, Ints]:
    """Integer barycentric corners (k, 3) of a triangle cut into resolution^2 triangles, and these."""
    i, j = np.indices((resolution + 1, resolution + 1))
    inside = i + j <= resolution
    at = np.cumsum(inside).reshape(inside.shape) - 1
    a, b = np.indices((resolution, resolution)).reshape(2, -1)
    up, down = a + b < resolution, a + b < resolution - 1
    upright = np.column_stack([at[a, b], at[a + 1, b], at[a, b + 1]])[up]
    hanging = np.column_stack([at[a + 1, b], at[a + 1, b + 1], at[a, b + 1]])[down]
    return np.stack([i, j, resolution - i - j], axis=-1)[inside], np.concatenate([upright, hanging])
