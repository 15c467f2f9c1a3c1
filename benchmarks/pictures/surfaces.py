"""Pictures of the way from a curve network to a surface."""

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
from tracemesh.geometry.network import CurveNetwork
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
