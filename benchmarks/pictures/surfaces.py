"""Pictures of the way from a curve network to a surface."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from benchmarks.data import built_in
from benchmarks.linear_surfaces import biharmonic, planar_patches
from benchmarks.measuring import Floats, Ints
from benchmarks.pictures.canvas import (
    BLUE,
    GREY,
    ORANGE,
    by_value,
    draw_mesh,
    draw_network,
    facing,
    figure,
    plain,
    plane,
    space,
)
from benchmarks.truths import MeshTruth
from tracemesh.geometry.curves.spline_network import resample_network
from tracemesh.geometry.network import CurveNetwork, Segment
from tracemesh.geometry.surfaces.cell_complex import cell_complex
from tracemesh.geometry.surfaces.curvature import normalised
from tracemesh.geometry.surfaces.patches import outlines_of
from tracemesh.geometry.surfaces.surface import SurfaceParameters, span_surface

STEP = 0.02
UNIT = "distance to the truth, mm"


def spline_network() -> Figure:
    """Few points, unevenly spaced, and the even network through them."""
    drawn = figure()
    truth = built_in("egg").network(STEP)
    sparse = _thinned(built_in("egg").network(STEP / 2))
    even = resample_network(sparse, STEP)
    for position, title, network in ((121, "as drawn", sparse), (122, "resampled", even)):
        axes = space(drawn, truth.points, position, f"{title}: {len(network.points)} points", (12, -50))
        draw_network(axes, network, GREY, 0.8)
        axes.scatter(*network.points.T, s=6, color=ORANGE if position == 121 else BLUE, depthshade=False, zorder=3)
    return drawn


def cycles() -> Figure:
    """Faces found between the curves, one colour each."""
    drawn = figure()
    for position, name in ((121, "leaf"), (122, "egg")):
        network = built_in(name).network(STEP)
        mesh = span_surface(network).mesh
        axes = space(drawn, mesh.vertices, position, f"{name}: {len(np.unique(mesh.patch))} faces")
        draw_mesh(axes, mesh.vertices, mesh.faces, np.asarray(colormaps["tab20"](mesh.patch % 20)))
        draw_network(axes, facing(axes, network))
    return drawn


def patches() -> Figure:
    """One patch in the plane and all of them in space."""
    drawn = figure()
    network = built_in("leaf").network(STEP)
    flat = planar_patches(network)
    largest = int(np.bincount(flat.patch).argmax())
    axes = plane(drawn, 121, "one patch in its plane", "m", "m")
    corners = list(flat.planar[flat.patch == largest])
    axes.add_collection(PolyCollection(corners, facecolors="#dce8f2", edgecolors=BLUE, linewidths=0.5))
    axes.autoscale_view()
    axes.set_aspect("equal")
    mesh = span_surface(network).mesh
    right = space(drawn, mesh.vertices, 122, "all patches on the surface")
    draw_mesh(right, mesh.vertices, mesh.faces, plain(mesh.faces), edges=True)
    draw_network(right, network)
    return drawn


def several_loops() -> Figure:
    """A face with four loops, cut open along slits, and a surface of six separate circles."""
    drawn = figure()
    plate = _circles([((0, 0, 0), 1.0), ((-0.4, -0.2, 0), 0.2), ((0.4, -0.2, 0), 0.2), ((0, 0.5, 0), 0.2)])
    disk = span_surface(plate).mesh
    axes = plane(drawn, 121, "a plate with three holes and its slits", "m", "m")
    corners = list(disk.vertices[disk.faces, :2])
    axes.add_collection(PolyCollection(corners, facecolors="#dce8f2", edgecolors=BLUE, linewidths=0.5))
    walk = outlines_of(cell_complex(plate))[0].vertex
    vertex, times = np.unique(walk, return_counts=True)
    axes.scatter(*disk.vertices[vertex[times > 1], :2].T, s=12, color=ORANGE, zorder=3)
    axes.autoscale_view()
    axes.set_aspect("equal")
    globe = _circles([(0.87 * axis, 0.5) for axis in (*np.eye(3), *-np.eye(3))])
    mesh = span_surface(globe).mesh
    right = space(drawn, mesh.vertices, 122, "a sphere of six openings")
    draw_mesh(right, mesh.vertices, mesh.faces, plain(mesh.faces), edges=True)
    draw_network(right, facing(right, globe))
    return drawn


def _circles(specs: Sequence[tuple[Sequence[float] | Floats, float]]) -> CurveNetwork:
    """Open circles of (centre, radius): of a sphere around the origin, or of the plane if all centres lie in it."""
    up, flat = np.array([0.0, 0.0, 1.0]), not any(centre[2] for centre, _ in specs)
    points, normals, segments = np.empty((0, 3)), np.empty((0, 3)), []
    for number, (centre, radius) in enumerate(specs):
        along = up if flat else normalised(np.asarray(centre))
        first = normalised(np.cross(along, np.eye(3)[np.argmin(abs(along))]))
        count = round(50 * radius)
        turn = 2 * np.pi * np.arange(count)[:, None] / count
        circle = centre + radius * (np.cos(turn) * first + np.sin(turn) * np.cross(along, first))
        segments.append(Segment(np.append(np.arange(count), 0) + len(points), True, number))
        points = np.vstack([points, circle])
        normals = np.vstack([normals, np.tile(up, (count, 1)) if flat else normalised(circle)])
    return CurveNetwork(points, normals, np.empty(0, np.int64), tuple(segments))


def surface() -> Figure:
    """Biharmonic patches and the surface that also takes the normals."""
    network = built_in("egg").network(STEP)
    flat, mesh = planar_patches(network), span_surface(network).mesh
    return _errors(
        network,
        ("positions alone (biharmonic)", biharmonic(flat), flat.faces),
        ("positions and normals", mesh.vertices, mesh.faces),
    )


def curvature() -> Figure:
    """Mean curvature, which changes its sign."""
    drawn = figure(5.0)
    network = built_in("leaf").network(STEP / 2)
    mesh = span_surface(network).mesh
    axes = space(drawn, mesh.vertices, 111, "mean curvature of the leaf", (50, -70))
    scale = Normalize(*np.quantile(np.abs(mesh.mean_curvature), 0.98) * np.array([-1, 1]))
    draw_mesh(axes, mesh.vertices, mesh.faces, by_value(drawn, axes, mesh.mean_curvature, mesh.faces, "1/m", scale))
    return drawn


def refinement() -> Figure:
    """Distance to the truth before and after the refinement."""
    network = built_in("egg").network(STEP)
    off = span_surface(network, SurfaceParameters(refinement="off")).mesh
    on = span_surface(network, SurfaceParameters(refinement="on")).mesh
    return _errors(network, ("linear", off.vertices, off.faces), ("refined", on.vertices, on.faces))


def evaluation() -> Figure:
    """Distance of a surface to the known one."""
    drawn = figure(5.0)
    network, truth = built_in("torus").network(STEP), MeshTruth(*built_in("torus").mesh(128))
    mesh = span_surface(network).mesh
    axes = space(drawn, mesh.vertices, 111, "a surface over exact curves, and how far it is from the truth", (20, 20))
    distance = 1e3 * truth.distance(mesh.vertices)
    scale = Normalize(0, distance.max())
    draw_mesh(axes, mesh.vertices, mesh.faces, by_value(drawn, axes, distance, mesh.faces, UNIT, scale))
    draw_network(axes, facing(axes, network), "white", 0.8)
    return drawn


def _thinned(network: CurveNetwork) -> CurveNetwork:
    """The network without three of four points inside its segments, taken out at random."""
    generator = np.random.default_rng(1)
    kept = generator.random(len(network.points)) < 0.25
    kept[network.nodes] = True
    number = np.cumsum(kept) - 1
    segments = tuple(replace(s, points=number[s.points[kept[s.points]]]) for s in network.segments)
    return CurveNetwork(network.points[kept], network.normals[kept], number[network.nodes], segments)


def _errors(network: CurveNetwork, *surfaces: tuple[str, Floats, Ints]) -> Figure:
    """Surfaces over the egg's network, coloured by their distance to it on one scale."""
    drawn, truth = figure(), MeshTruth(*built_in("egg").mesh(128))
    distances = [1e3 * truth.distance(vertices) for _, vertices, _ in surfaces]
    scale = Normalize(0, max(d.max() for d in distances))
    for position, (title, vertices, faces), distance in zip((121, 122), surfaces, distances, strict=True):
        axes = space(drawn, network.points, position, f"{title}: mean {distance.mean():.3f} mm", (12, -50))
        draw_mesh(axes, vertices, faces, by_value(drawn, axes, distance, faces, UNIT, scale))
        draw_network(axes, facing(axes, network), "white", 0.8)
    return drawn
