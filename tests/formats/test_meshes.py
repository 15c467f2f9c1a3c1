"""Mesh files: what is written is read back, by us and by trimesh; GLB is y up and says where it comes from."""

import json
import struct
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tracemesh.errors import InputError
from tracemesh.formats.meshes import read_mesh, write_mesh, write_triangles
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.simulated.shapes import leaf

SHAPE = leaf()
NETWORK = SHAPE.network(0.03)


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    vertices, faces = SHAPE.mesh(12)
    normals = np.array(trimesh.Trimesh(vertices, faces, process=False).vertex_normals)
    curvature = np.linspace(-3, 3, len(vertices))
    return Mesh(vertices, faces, normals, curvature, curvature**2 - 1, np.zeros(len(faces), np.int64))


def tree(glb: bytes) -> dict[str, Any]:
    magic, version, total, length = struct.unpack("<4sIII", glb[:16])
    assert (magic, version, total) == (b"glTF", 2, len(glb))
    result = json.loads(glb[20 : 20 + length])
    assert isinstance(result, dict)
    return result


@pytest.mark.parametrize("extension", ["glb", "obj", "ply"])
def test_reading_undoes_writing(mesh: Mesh, extension: str) -> None:
    vertices, faces = read_mesh(write_mesh(mesh, extension), extension)
    np.testing.assert_allclose(vertices, mesh.vertices, atol=1e-7)
    assert faces.tolist() == mesh.faces.tolist()


def test_stl_keeps_the_triangles(mesh: Mesh) -> None:
    vertices, faces = read_mesh(write_mesh(mesh, "stl"), "stl")
    assert len(vertices) == len(mesh.vertices)
    np.testing.assert_allclose(vertices[faces], mesh.vertices[mesh.faces], atol=1e-7)


def test_glb_is_y_up_with_normals_curvature_and_network(mesh: Mesh) -> None:
    scene = trimesh.load_scene(BytesIO(write_mesh(mesh, "glb", NETWORK)), file_type="glb", process=False)
    assert set(scene.graph.nodes_geometry) == {"surface", "network"}
    assert all(np.array_equal(scene.graph.get(name)[0], np.eye(4)) for name in scene.graph.nodes_geometry)
    surface = scene.geometry["surface"]
    np.testing.assert_allclose(surface.vertices[:, 1], mesh.vertices[:, 2], atol=1e-7)
    np.testing.assert_allclose(surface.vertices[:, 2], -mesh.vertices[:, 1], atol=1e-7)
    np.testing.assert_allclose(surface.vertex_normals[:, 1], mesh.normals[:, 2], atol=1e-6)
    attributes = {name: values.ravel() for name, values in surface.vertex_attributes.items()}
    np.testing.assert_allclose(attributes["_MEAN_CURVATURE"], mesh.mean_curvature, atol=1e-6)
    np.testing.assert_allclose(attributes["_GAUSSIAN_CURVATURE"], mesh.gaussian_curvature, atol=1e-6)


def network_primitive(glb: bytes) -> dict[str, Any]:
    part = next(m for m in tree(glb)["meshes"] if m["name"] == "network")
    (primitive,) = part["primitives"]
    assert isinstance(primitive, dict)
    return primitive


def accessor_values(glb: bytes, number: int, width: int) -> np.ndarray:
    document = tree(glb)
    accessor = document["accessors"][number]
    start = 28 + struct.unpack("<I", glb[12:16])[0] + document["bufferViews"][accessor["bufferView"]]["byteOffset"]
    return np.frombuffer(glb, "<f4", width * accessor["count"], start).reshape(-1, 2, width)


EDGES = np.concatenate([np.column_stack([s.points[:-1], s.points[1:]]) for s in NETWORK.segments])


def test_glb_holds_every_edge_of_the_network_as_a_line(mesh: Mesh) -> None:
    glb = write_mesh(mesh, "glb", NETWORK)
    primitive = network_primitive(glb)
    assert primitive["mode"] == 1
    assert "indices" not in primitive
    assert set(primitive["attributes"]) == {"POSITION"}
    ends = accessor_values(glb, primitive["attributes"]["POSITION"], 3)
    np.testing.assert_allclose(ends[..., [0, 2, 1]] * [1, -1, 1], NETWORK.points[EDGES], atol=1e-7)


def test_glb_holds_the_uncertainty_of_both_ends_of_every_edge(mesh: Mesh) -> None:
    uncertainty = np.linspace(0.001, 0.002, len(NETWORK.points))
    glb = write_mesh(mesh, "glb", replace(NETWORK, uncertainty=uncertainty))
    stated = accessor_values(glb, network_primitive(glb)["attributes"]["_UNCERTAINTY"], 1)
    np.testing.assert_allclose(stated[..., 0], uncertainty[EDGES], rtol=1e-6)


def test_glb_is_right_handed_after_the_change_of_axes(mesh: Mesh) -> None:
    scene = trimesh.load_scene(BytesIO(write_mesh(mesh, "glb")), file_type="glb", process=False)
    surface = scene.geometry["surface"]
    assert np.einsum("ij,ij->i", surface.face_normals, surface.vertex_normals[surface.faces[:, 0]]).min() > 0.5


def test_glb_says_where_it_comes_from_and_can_be_seen_from_both_sides(mesh: Mesh) -> None:
    provenance: dict[str, object] = {"generator": "tracemesh 9", "recordings": ["a"], "parameters": {"step": 0.01}}
    document = tree(write_mesh(mesh, "glb", NETWORK, provenance))
    assert document["asset"] == {"version": "2.0", "generator": "tracemesh 9", "extras": provenance}
    materials = document["materials"]
    assert materials[0]["doubleSided"] is True


def test_glb_accessors_hold_the_bounds_that_the_standard_demands(mesh: Mesh) -> None:
    document = tree(write_mesh(mesh, "glb", NETWORK))
    accessors, meshes = document["accessors"], document["meshes"]
    for part in meshes:
        for primitive in part["primitives"]:
            position = accessors[primitive["attributes"]["POSITION"]]
            assert all(len(position[bound]) == 3 for bound in ("min", "max"))


def test_ply_keeps_normals_and_curvature(mesh: Mesh) -> None:
    loaded = trimesh.load(BytesIO(write_mesh(mesh, "ply")), file_type="ply", process=False)
    np.testing.assert_allclose(loaded.vertex_normals, mesh.normals, atol=1e-6)
    data = loaded.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_allclose(data["mean_curvature"], mesh.mean_curvature, atol=1e-6)
    np.testing.assert_allclose(data["gaussian_curvature"], mesh.gaussian_curvature, atol=1e-6)


def test_reads_the_true_meshes(shared_data: Path) -> None:
    vertices, faces = read_mesh((shared_data / "lilium.obj").read_bytes(), "obj", "lilium.obj")
    assert (len(vertices), len(faces)) == (3389, 6590)
    assert vertices[0] == pytest.approx([-0.559538, 0.51809, 0.0661723])


@pytest.mark.parametrize(
    ("content", "extension", "words"),
    [
        (b"", "glb", "cannot be read as glb"),
        (b"no mesh at all", "ply", "cannot be read as ply"),
        (b"", "obj", "wanted triangles, got none"),
        (b"v 0 0 0\nf 1 2 3\n", "obj", "x.obj"),
        (b"v 0\nv 1\nv 2\nf 1 2 3\n", "obj", "wanted three coordinates"),
        (b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "obj", "vertex 1 is not finite"),
        (b"", "3ds", "wanted a mesh format among glb, obj, ply, stl, got '3ds'"),
    ],
)
def test_bad_files_are_input_errors(content: bytes, extension: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_mesh(content, extension, f"x.{extension}")


def test_an_unknown_format_is_refused(mesh: Mesh) -> None:
    with pytest.raises(InputError, match="got 'dae'"):
        write_mesh(mesh, "dae")


@pytest.mark.parametrize("extension", ["obj", "ply", "stl"])
def test_bare_triangles_can_be_written(mesh: Mesh, extension: str) -> None:
    vertices, faces = read_mesh(write_triangles(mesh.vertices, mesh.faces, extension), extension)
    np.testing.assert_allclose(vertices[faces], mesh.vertices[mesh.faces], atol=1e-7)


def test_bare_triangles_have_no_glb() -> None:
    with pytest.raises(InputError, match="got 'glb'"):
        write_triangles(np.eye(3), np.array([[0, 1, 2]]), "glb")
