"""Whether every mesh can be worked with: manifold, oriented, of the right kind, no triangle turned over."""

from collections.abc import Iterator

import numpy as np

from benchmarks.data import Data, built_in
from benchmarks.table import Cell, Column, Table
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.geometry.curves.reconstruction import reconstruct_network
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork, Ints
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.surfaces.edges import unique_edges
from tracemesh.geometry.surfaces.quality import mesh_quality
from tracemesh.geometry.surfaces.surface import span_surface

CLOSED = {"sphere": 2, "torus": 0, "bumpy": 2}
"""Euler number of the shapes whose exact networks are closed; every other network and every scan is of a disk."""
BUILT_IN = {"egg": 2}
SMALLEST_ANGLE = 15.0  # degrees, wanted

COLUMNS = (
    Column("network or scan"),
    Column("vertices", "d"),
    Column("manifold"),
    Column("oriented"),
    Column("Euler number", "d"),
    Column("true", "d"),
    Column("turned over", "d"),
    Column("smallest angle, degrees", ".1f"),
    Column("in order"),
)


def meshes(data: Data, names: tuple[str, ...] = tuple(SHAPES), with_networks: bool = True) -> Table:
    """Table of every network and scan of the folder, and of built-in shapes by name, by default settings.

    with_networks: False takes the folder's scans alone.
    """
    rows = tuple(_row(*one) for one in _networks(data, names, with_networks))
    note = f"""Default settings. Manifold: no edge with more than two triangles, no vertex unused. Oriented: neighbours
        run along their common edge in opposite directions. Turned over: triangles that look more than 90 degrees away
        from the normals propagated to their corners. In order: all of it right and no angle below
        {SMALLEST_ANGLE:.0f} degrees. Every triangle is counted, those at acute corners of the network too."""
    return Table("meshes", "Meshes of every network and scan", COLUMNS, rows, (note,))


def _networks(data: Data, names: tuple[str, ...], with_networks: bool) -> Iterator[tuple[str, CurveNetwork, int]]:
    """Names, networks and true Euler numbers."""
    for name in names:
        yield f"{name} (built in)", built_in(name).network(0.02), BUILT_IN.get(name, 1)
    for name, network in data.networks() if with_networks else ():
        yield name, network, CLOSED.get(name.split("-")[0], 1)
    for kind in ("exact", "noisy"):
        for known in data.scans(kind):
            yield f"{known.name} scan", reconstruct_network(known.scan).network, 1
    if data.folder is not None:
        scan = read_rawnet((data.folder / "lilium.rawnet").read_text(), "lilium.rawnet")
        yield "lilium.rawnet", reconstruct_network(scan).network, 1


def _row(name: str, network: CurveNetwork, euler: int) -> tuple[Cell, ...]:
    mesh = span_surface(network).mesh
    quality = mesh_quality(mesh.vertices, mesh.faces, mesh.normals)
    manifold, oriented = is_manifold(mesh), is_oriented(mesh.faces)
    right = manifold and oriented and quality.euler_number == euler and not quality.inverted_faces
    in_order = right and quality.min_angle_deg >= SMALLEST_ANGLE
    said = ["yes" if fact else "no" for fact in (manifold, oriented, in_order)]
    figures = (quality.euler_number, euler, quality.inverted_faces, quality.min_angle_deg)
    return (name, quality.vertices, *said[:2], *figures, said[2])


def is_manifold(mesh: Mesh) -> bool:
    """Whether no edge has more than two triangles and every vertex is used."""
    return int(unique_edges(mesh.faces)[1].max()) <= 2 and len(np.unique(mesh.faces)) == len(mesh.vertices)


def is_oriented(faces: Ints) -> bool:
    """Whether no directed edge occurs twice. faces: (f, 3)."""
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    return len(np.unique(directed, axis=0)) == len(directed)
