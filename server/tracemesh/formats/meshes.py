"""Mesh files: GLB (y up, as glTF demands), OBJ, PLY and STL (z up, the kernel's own axes); all in metres."""

from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.exchange.gltf import export_glb
from trimesh.exchange.obj import export_obj
from trimesh.exchange.ply import export_ply
from trimesh.exchange.stl import export_stl
from trimesh.path import Path3D
from trimesh.path.entities import Line
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from tracemesh.errors import InputError
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork, Floats, Ints

Provenance = dict[str, object]

SURFACE = PBRMaterial(
    name="surface", baseColorFactor=[200, 205, 210, 255], metallicFactor=0.0, roughnessFactor=0.7, doubleSided=True
)
OBJ_DIGITS = 9
"""Decimals of a metre."""
LARGEST = 1e9
"""m from the origin, along an axis; vertices beyond could not be merged without an overflow."""


def write_mesh(
    mesh: Mesh, extension: str, network: CurveNetwork | None = None, provenance: Provenance | None = None
) -> bytes:
    """File of a mesh; extension: glb, obj, ply or stl; raises InputError for any other.

    GLB: a node `surface` with normals and the attributes _MEAN_CURVATURE (1/m) and _GAUSSIAN_CURVATURE (1/m^2); with a
    network, a node `network` of line segments, with the attribute _UNCERTAINTY (m) where that is known; provenance in
    asset.extras. PLY keeps normals, mean_curvature and gaussian_curvature, OBJ normals, STL triangles only.
    """
    writers: dict[str, Callable[[], bytes]] = {
        "glb": lambda: _glb(mesh, network, provenance or {}),
        "obj": lambda: _obj(mesh),
        "ply": lambda: _ply(mesh),
        "stl": lambda: bytes(export_stl(_trimesh(mesh.vertices, mesh.faces))),
    }
    if extension not in writers:
        raise InputError(f"wanted a mesh format among {', '.join(writers)}, got {extension!r}")
    return writers[extension]()


def write_triangles(vertices: Floats, faces: Ints, extension: str) -> bytes:
    """OBJ, PLY or STL file (z up) of bare triangles; raises InputError for any other extension."""
    if extension not in ("obj", "ply", "stl"):
        raise InputError(f"wanted a mesh format among obj, ply, stl, got {extension!r}")
    triangles = _trimesh(vertices, faces)
    if extension == "obj":
        return str(export_obj(triangles, header="metres, z up", digits=OBJ_DIGITS)).encode()
    return bytes(export_ply(triangles) if extension == "ply" else export_stl(triangles))


def read_mesh(content: bytes, extension: str, source: str = "") -> tuple[Floats, Ints]:
    """Vertices (n, 3) m, z up, and triangles (m, 3) of a glb, obj, ply or stl file.

    Polygons are cut into triangles, everything but surfaces is ignored. Raises InputError when there are none, or when
    the file cannot be understood.
    """
    name, extension = source or "mesh", extension.lower()
    if extension not in ("glb", "obj", "ply", "stl"):
        raise InputError(f"{name}: wanted a mesh format among glb, obj, ply, stl, got {extension!r}")
    try:
        options: dict[str, Any] = {"maintain_order": True, "skip_materials": True} if extension == "obj" else {}
        loaded = trimesh.load_scene(BytesIO(content), file_type=extension, process=False, **options)
        found = [g for g in loaded.dump() if isinstance(g, trimesh.Trimesh) and len(g.faces)]
    except Exception as error:  # a parser of foreign files fails in any way it likes
        raise InputError(f"{name}: cannot be read as {extension}: {error}") from None
    if not found:
        raise InputError(f"{name}: wanted triangles, got none")
    return _arrays(found, name, extension)


def _arrays(found: list[Any], name: str, extension: str) -> tuple[Floats, Ints]:
    mesh: Any = found[0] if len(found) == 1 else trimesh.util.concatenate(found)
    _check_vertices(np.array(mesh.vertices, np.float64), name)
    if extension == "stl":  # which stores each triangle's corners anew
        mesh.merge_vertices()
    vertices, faces = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            f"{name}: wanted vertex indices from 0 to {len(vertices) - 1}, got {faces.min()}..{faces.max()}"
        )
    return (_z_up(vertices) if extension == "glb" else vertices), faces


def _check_vertices(vertices: Floats, name: str) -> None:
    if vertices.shape[1:] != (3,):
        raise InputError(f"{name}: wanted three coordinates of every vertex, got an array of shape {vertices.shape}")
    wrong = ~(np.abs(vertices) <= LARGEST).all(axis=1)
    if wrong.any():
        raise InputError(f"{name}: vertex {int(wrong.argmax())} is not finite, or further away than {LARGEST:g} m")


def _glb(mesh: Mesh, network: CurveNetwork | None, provenance: Provenance) -> bytes:
    attributes = {f"_{name.upper()}": values for name, values in _curvatures(mesh).items()}
    surface = _trimesh(
        _y_up(mesh.vertices),
        mesh.faces,
        vertex_normals=_y_up(mesh.normals),
        vertex_attributes=attributes,
        visual=TextureVisuals(material=SURFACE),
    )
    scene = trimesh.Scene()
    scene.add_geometry(surface, node_name="surface", geom_name="surface")
    if network is not None:
        scene.add_geometry(_lines(network), node_name="network", geom_name="network")

    def describe(tree: dict[str, Any]) -> None:
        tree["asset"] = {
            "version": "2.0",
            "generator": str(provenance.get("generator", "tracemesh")),
            "extras": provenance,
        }

    return bytes(export_glb(scene, include_normals=True, tree_postprocessor=describe))


def _obj(mesh: Mesh) -> bytes:
    surface = _trimesh(mesh.vertices, mesh.faces, vertex_normals=mesh.normals)
    return str(export_obj(surface, include_normals=True, header="metres, z up", digits=OBJ_DIGITS)).encode()


def _ply(mesh: Mesh) -> bytes:
    surface = _trimesh(mesh.vertices, mesh.faces, vertex_normals=mesh.normals, vertex_attributes=_curvatures(mesh))
    return bytes(export_ply(surface, vertex_normal=True))


def _curvatures(mesh: Mesh) -> dict[str, NDArray[np.float32]]:
    named = {"mean_curvature": mesh.mean_curvature, "gaussian_curvature": mesh.gaussian_curvature}
    return {name: values.astype(np.float32) for name, values in named.items()}


def _lines(network: CurveNetwork) -> Path3D:
    """The network's edges, each a line of its own: values at points are written for lines of equal length only."""
    edges = np.concatenate([np.column_stack([s.points[:-1], s.points[1:]]) for s in network.segments])
    known = {} if network.uncertainty is None else {"_UNCERTAINTY": network.uncertainty}
    return Path3D([Line(edge) for edge in edges], _y_up(network.points), vertex_attributes=known, process=False)


def _trimesh(vertices: Floats, faces: Ints, **properties: Any) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False, **properties)


def _y_up(vectors: Floats) -> Floats:
    return np.column_stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]])


def _z_up(vectors: Floats) -> Floats:
    return np.column_stack([vectors[:, 0], -vectors[:, 2], vectors[:, 1]])
