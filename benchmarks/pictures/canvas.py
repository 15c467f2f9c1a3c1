"""One look for all pictures: colours, axes in space, curves and meshes on them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from benchmarks.measuring import Floats, Ints
from tracemesh.geometry.network import CurveNetwork, Segment

INK, BLUE, ORANGE, GREEN, GREY = "#1b2733", "#2272b4", "#e07a1f", "#2f8f5b", "#9aa5b1"
CURVES = (BLUE, ORANGE, GREEN, "#a23b72", "#7a6fbe", "#c0a000", "#4aa3a2")

Axes = Any  # matplotlib's axes carry no types


def figure(width: float = 8.0, height: float = 3.2) -> Figure:
    """An empty figure, inches."""
    return Figure((width, height), dpi=120, layout="constrained", facecolor="white")


def save(drawn: Figure, path: Path) -> None:
    """Write a PNG that is the same file whenever the picture is the same."""
    drawn.savefig(path, metadata={"Software": None})


def plane(drawn: Figure, position: int = 111, title: str = "", x: str = "", y: str = "") -> Axes:
    """Axes for a plot of one quantity over another."""
    axes = drawn.add_subplot(position)
    axes.set_title(title, fontsize=9, color=INK)
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)
    return axes


def space(
    drawn: Figure, points: Floats, position: int = 111, title: str = "", view: tuple[int, int] = (35, -60)
) -> Axes:
    """Axes in space without frame, all lengths alike, filled by the points (n, 3)."""
    axes = drawn.add_subplot(position, projection="3d", computed_zorder=False)
    axes.set_title(title, fontsize=9, color=INK)
    axes.set_axis_off()
    low, high = points.min(0), points.max(0)
    for name, least, most in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{name}lim")(least, most)
    axes.set_box_aspect(high - low, zoom=1.05)
    axes.view_init(*view)
    return axes


def draw_network(axes: Axes, network: CurveNetwork, colour: str | None = INK, width: float = 1.6) -> None:
    """Curves, each in its own colour when none is given, and nodes."""
    lines = [network.points[s.points] for s in network.segments]
    colours = [colour or CURVES[s.curve % len(CURVES)] for s in network.segments]
    axes.add_collection3d(Line3DCollection(lines, colors=colours, linewidths=width, zorder=2))
    axes.scatter(*network.points[network.nodes].T, s=14, color=colour or INK, depthshade=False, zorder=3)


def facing(axes: Axes, network: CurveNetwork) -> CurveNetwork:
    """The edges of a network that are on the side of a surface that one sees, without nodes."""
    turn, up = np.radians(axes.azim), np.radians(axes.elev)
    towards = np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    seen = network.normals @ towards > 0
    every = [Segment(pair, s.boundary, s.curve) for s in network.segments for pair in _pairs(s.points)]
    edges = [edge for edge in every if seen[edge.points].all()]
    return replace(network, nodes=network.nodes[:0], segments=tuple(edges))


def _pairs(points: Ints) -> Ints:
    return np.column_stack([points[:-1], points[1:]])


def draw_mesh(axes: Axes, vertices: Floats, faces: Ints, colours: Floats, edges: bool = False) -> None:
    """Shaded triangles; colours: (m, 4) of the faces."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = 0.72 + 0.28 * np.abs(normals @ LightSource(azdeg=225, altdeg=50).direction)
    shaded = np.column_stack([colours[:, :3] * light[:, None], np.ones(len(colours))])
    line = {"edgecolors": "#33415580", "linewidths": 0.25} if edges else {"edgecolors": shaded, "linewidths": 0.2}
    axes.add_collection3d(Poly3DCollection(corners, facecolors=shaded, **line))


def plain(faces: Ints) -> Floats:
    """One colour (m, 4) for all faces."""
    return np.tile([0.62, 0.74, 0.85, 1.0], (len(faces), 1))


def by_value(drawn: Figure, axes: Axes, values: Floats, faces: Ints, label: str, scale: Normalize) -> Floats:
    """Colours (m, 4) of faces by the mean of values (n,) at their corners, and a bar that explains them."""
    name = "RdBu_r" if scale(0.0) == 0.5 else "viridis"
    bar = drawn.colorbar(ScalarMappable(scale, name), ax=axes, shrink=0.7, pad=0.02)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=7)
    return np.asarray(colormaps[name](scale(values[faces].mean(1))))
