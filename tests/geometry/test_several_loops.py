"""Faces with several boundary loops: the right loops are joined, and the mesh has the right Euler number."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.geometry.network_fixtures import octants, radial, upwards
from tests.geometry.test_surface import assert_oriented_manifold
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork, Floats, Segment
from tracemesh.geometry.surfaces.bridges import joined_outline
from tracemesh.geometry.surfaces.cell_complex import cell_complex
from tracemesh.geometry.surfaces.planar_maps import parted
from tracemesh.geometry.surfaces.quality import mesh_quality
from tracemesh.geometry.surfaces.surface import span_surface

Circle = tuple[Sequence[float], Sequence[float], float]
AXES = [tuple(axis) for axis in (*np.eye(3), *-np.eye(3))]
EQUATOR = [(np.cos(t), np.sin(t), 0.0) for t in (0, 2 * np.pi / 3, 4 * np.pi / 3)]


def circles(specs: Sequence[Circle], normal: Callable[[Floats], Floats], boundary: bool) -> CurveNetwork:
    """Closed curves without nodes: circles of (centre, axis, radius)."""
    points, segments, begin = [], [], 0
    for curve, (centre, axis, radius) in enumerate(specs):
        along = np.array(axis) / np.linalg.norm(axis)
        first = radial(np.cross(along, np.eye(3)[np.argmin(abs(along))])[None])[0]
        count = max(12, round(50 * radius))
        turn = 2 * np.pi * np.arange(count)[:, None] / count
        points.append(centre + radius * (np.cos(turn) * first + np.sin(turn) * np.cross(along, first)))
        segments.append(Segment(np.append(np.arange(count), 0) + begin, boundary, curve))
        begin += count
    stacked = np.vstack(points)
    return CurveNetwork(stacked, normal(stacked), np.empty(0, np.int64), tuple(segments))


def on_sphere(axes: Sequence[Sequence[float]], radius: float, boundary: bool = False) -> CurveNetwork:
    """Circles of one radius around axes of the unit sphere."""
    height = np.sqrt(1 - radius**2)
    return circles(
        [(height * np.array(a) / np.linalg.norm(a), a, radius) for a in axes],  # type: ignore[misc]
        radial,
        boundary,
    )


def plate(holes: Sequence[tuple[float, float, float]], boundary: bool = True) -> CurveNetwork:
    """A flat disk of radius 1 with circles of (x, y, radius) in it."""
    up = (0.0, 0.0, 1.0)
    rims: list[Circle] = [((x, y, 0.0), up, r) for x, y, r in holes]
    return circles([((0.0, 0.0, 0.0), up, 1.0), *rims], upwards, boundary)


def together(one: CurveNetwork, other: CurveNetwork) -> CurveNetwork:
    shift = len(one.points)
    moved = tuple(Segment(s.points + shift, s.boundary, s.curve + len(one.segments)) for s in other.segments)
    return CurveNetwork(
        np.vstack([one.points, other.points]), np.vstack([one.normals, other.normals]), one.nodes, one.segments + moved
    )


def box(parts: int = 10) -> CurveNetwork:
    """The edges of a unit cube, with the normals of a sphere around it."""
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    edges = [(a, b) for a in range(8) for b in range(a) if np.abs(corners[a] - corners[b]).sum() == 1]
    points, segments, count = [corners], [], 8
    for curve, (a, b) in enumerate(edges):
        t = np.arange(1, parts)[:, None] / parts
        points.append((1 - t) * corners[a] + t * corners[b])
        segments.append(Segment(np.array([a, *range(count, count + parts - 1), b]), False, curve))
        count += parts - 1
    stacked = np.vstack(points)
    return CurveNetwork(stacked, radial(stacked - 0.5), np.arange(8), tuple(segments))


def torus_with_a_band(meridians: int, arcs: int) -> CurveNetwork:
    """Meridians of a torus, R = 4, r = 2, some neighbours of which are joined along the outer equator."""

    def at(phi: Floats, theta: Floats) -> tuple[Floats, Floats]:
        out = np.column_stack([np.cos(phi), np.sin(phi), 0 * phi])
        up = np.array([0.0, 0.0, 1.0])
        normal = np.cos(theta)[:, None] * out + np.sin(theta)[:, None] * up
        return 4 * out + 2 * normal, normal

    around = 2 * np.pi * np.arange(meridians) / meridians
    fields, segments, count = [at(around, 0 * around)], [], meridians
    for k in range(meridians):
        theta = 2 * np.pi * np.arange(1, 32) / 32
        fields.append(at(np.full(31, around[k]), theta))
        segments.append(Segment(np.array([k, *range(count, count + 31), k]), False, k))
        count += 31
    for k in range(arcs):
        phi = around[k] + around[1] * np.arange(1, 24) / 24
        fields.append(at(phi, 0 * phi))
        segments.append(Segment(np.array([k, *range(count, count + 23), (k + 1) % meridians]), False, meridians + k))
        count += 23
    points, normals = (np.vstack(field) for field in zip(*fields, strict=True))
    return CurveNetwork(points, normals, np.arange(meridians), tuple(segments))


def sound(network: CurveNetwork, euler: int, loops: int) -> Mesh:
    mesh = span_surface(network).mesh
    assert_oriented_manifold(mesh)
    quality = mesh_quality(mesh.vertices, mesh.faces, mesh.normals)
    assert (quality.euler_number, quality.boundary_loops, quality.inverted_faces) == (euler, loops, 0)
    assert quality.min_angle_deg > 15
    np.testing.assert_array_equal(mesh.vertices[: len(network.points)], network.points)
    return mesh


@pytest.mark.parametrize(
    ("axes", "radius", "boundary", "euler", "loops"),
    [
        (EQUATOR, 0.5, False, 2, 0),
        (EQUATOR, 0.6, True, -1, 3),
        (AXES, 0.4, False, 2, 0),
        (AXES, 0.5, True, -4, 6),
        ([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], 0.6, True, -2, 4),
    ],
    ids=["three circles", "three openings", "six circles", "six openings", "four openings"],
)
def test_sphere_of_separate_circles(
    axes: Sequence[Sequence[float]], radius: float, boundary: bool, euler: int, loops: int
) -> None:
    network = on_sphere(axes, radius, boundary)
    assert [len(group) for group in cell_complex(network).groups] == [len(axes)]
    mesh = sound(network, euler, loops)
    assert abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 1e-3


@pytest.mark.parametrize(
    "holes",
    [
        [(0.3, 0.1, 0.15)],
        [(-0.4, 0.0, 0.25), (0.4, 0.0, 0.25)],
        [(-0.4, -0.2, 0.2), (0.4, -0.2, 0.2), (0.0, 0.5, 0.2)],
        [(-0.5, -0.5, 0.15), (0.5, -0.5, 0.15), (0.0, 0.0, 0.2), (-0.5, 0.5, 0.15), (0.5, 0.5, 0.15)],
    ],
    ids=["one", "two", "three", "five"],
)
def test_flat_plate_with_holes_is_flat_and_covers_its_area(holes: list[tuple[float, float, float]]) -> None:
    network = plate(holes)
    mesh = sound(network, 1 - len(holes), 1 + len(holes))
    assert abs(mesh.vertices[:, 2]).max() < 1e-9
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    polygons = [network.points[s.points[:-1]] for s in network.segments]
    areas = [0.5 * np.cross(p, np.roll(p, -1, axis=0))[:, 2].sum() for p in polygons]
    outer, *inner = map(abs, areas)
    assert np.cross(b - a, c - a)[:, 2].sum() / 2 == pytest.approx(outer - sum(inner), rel=1e-4)


def bent_plate(holes: Sequence[tuple[float, float, float]], along_y: float, bend: float = 1.0) -> CurveNetwork:
    """A plate with holes bent to z = bend (along_y y^2 - x^2), 1/m: a dome for -1, a saddle for 1."""
    flat = plate(holes)
    x, y, _ = flat.points.T
    height, slopes = bend * (along_y * y**2 - x**2), bend * np.column_stack([2 * x, -2 * along_y * y])
    normals = radial(np.column_stack([slopes, np.ones_like(x)]))
    return replace(flat, points=np.column_stack([x, y, height]), normals=normals)


@pytest.mark.parametrize("along_y", [-1.0, 1.0], ids=["dome", "saddle"])
@pytest.mark.parametrize(
    "holes",
    [[(-0.4, 0.0, 0.25), (0.4, 0.0, 0.25)], [(-0.6, 0.0, 0.08), (0.0, 0.6, 0.1), (0.5, -0.4, 0.12)]],
    ids=["two", "three"],
)
def test_holes_in_what_cannot_be_unrolled(holes: list[tuple[float, float, float]], along_y: float) -> None:
    """Steep at the rim, and curved both ways: the sides of a slit that was cut open cross in the plane."""
    sound(bent_plate(holes, along_y), 1 - len(holes), 1 + len(holes))


@pytest.mark.parametrize(
    ("hole", "along_y", "bend"),
    [((0.3, 0.1, 0.15), -1.0, 1.0), ((0.0, 0.0, 0.3), -1.0, 1.5), ((0.3, 0.1, 0.15), 0.0, 1.5)],
    ids=["beside the top", "at the top", "in a valley"],
)
def test_a_hole_whose_rim_would_turn_inside_out(hole: tuple[float, float, float], along_y: float, bend: float) -> None:
    """The way from the steep rim to the hole is longer than the rim's radius: unrolled, the hole has no room."""
    sound(bent_plate([hole], along_y, bend), 0, 2)


@pytest.mark.parametrize(
    "holes", [[(-0.4, 0.0, 0.25), (0.4, 0.0, 0.25)], [(-0.5, 0.2, 0.12), (0.1, -0.4, 0.2)]], ids=["alike", "unlike"]
)
def test_triangles_that_the_surface_put_out_of_shape_are_unrolled_again(
    holes: list[tuple[float, float, float]],
) -> None:
    """A dome whose rim is as steep as 3 leads far from the surface that its patch was first unrolled from."""
    sound(bent_plate(holes, -1.0, 1.5), -1, 3)


@pytest.mark.parametrize("start", [0, 5])
def test_where_a_band_is_cut_open_does_not_show(start: int) -> None:
    """Between two parallels of a sphere no way across is shorter than others: the cut is where the curves begin."""
    radius = np.sqrt(0.75)
    rings = circles([((0, 0, 0.5), (0, 0, 1), radius), ((0, 0, -0.5), (0, 0, -1), radius)], radial, True)
    begun = np.concatenate([np.roll(s.points[:-1], -start) for s in rings.segments])
    mesh = sound(replace(rings, points=rings.points[begun], normals=rings.normals[begun]), 0, 2)
    height, away = mesh.vertices[:, 2], np.linalg.norm(mesh.vertices, axis=1) - 1
    assert abs(away).max() < 1e-4
    assert abs(away - np.polyval(np.polyfit(height, away, 6), height)).max() < 1e-6


def test_plate_with_filled_circles_is_a_disk() -> None:
    network = plate([(-0.4, 0.0, 0.25), (0.4, 0.0, 0.25)], boundary=False)
    sound(network, 1, 1)


@pytest.mark.parametrize(("boundary", "euler"), [(False, 2), (True, 0)], ids=["circles", "holes"])
def test_two_inner_loops_in_one_face_among_others(boundary: bool, euler: int) -> None:
    in_an_octant = on_sphere([(1, 0.45, 0.45), (0.45, 1, 0.45)], 0.12, boundary)
    mesh = sound(together(octants(0.1), in_an_octant), euler, 2 * boundary)
    assert abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 1e-4
    up = (0.0, 0.0, 1.0)
    in_the_lid = circles([((0.3, 0.5, 1.0), up, 0.12), ((0.7, 0.5, 1.0), up, 0.12)], upwards, boundary)
    sound(together(box(), in_the_lid), euler, 2 * boundary)


@pytest.mark.parametrize(("meridians", "arcs"), [(4, 4), (4, 3), (6, 3)])
def test_bands_of_a_connected_network(meridians: int, arcs: int) -> None:
    network = torus_with_a_band(meridians, arcs)
    assert len(cell_complex(network).groups) == meridians - arcs
    vertices = sound(network, 0, 0).vertices
    distance = np.hypot(np.hypot(vertices[:, 0], vertices[:, 1]) - 4, vertices[:, 2]) - 2
    assert abs(distance).max() < 0.1


def test_outline_walks_every_loop_once_and_every_slit_twice() -> None:
    network = plate([(-0.4, 0.0, 0.25), (0.4, 0.0, 0.25)])
    complex_ = cell_complex(network)
    outline = joined_outline(network, [complex_.faces[k] for k in complex_.groups[0]], len(network.points))
    vertex, times = np.unique(outline.vertex, return_counts=True)
    assert set(range(len(network.points))) <= set(vertex.tolist())
    assert times.max() == 2
    assert (times[vertex >= len(network.points)] == 2).all()
    assert (times[vertex < len(network.points)] == 2).sum() == 4  # the ends of two slits
    apart = parted(outline.points[:, :2], outline.vertex)
    moved = np.linalg.norm(apart - outline.points[:, :2], axis=1)
    assert (moved[np.isin(outline.vertex, vertex[times == 1])] == 0).all()
    assert len(np.unique(apart.round(9), axis=0)) == len(apart)
