"""Laws of spanned surfaces on networks with known truth."""

from pathlib import Path

import numpy as np
import pytest

from tracemesh.formats.networks import read_network
from tracemesh.geometry.edges import unique_edges
from tracemesh.geometry.quality import mesh_quality
from tracemesh.geometry.surface import span_surface

EULER = {
    "sphere-3": 2, "sphere-9": 2, "torus-3": 0, "torus-9": 0, "field-2": 1,
    "field-4": 1, "bumpy-3": 2, "bumpy-9": 2, "lilium-2": 1, "lilium-5": 1,
}  # fmt: skip


@pytest.mark.parametrize("name", EULER)
def test_mesh_is_an_oriented_manifold_of_the_right_genus_through_the_network(name: str, shared_data: Path) -> None:
    network = read_network((shared_data / f"networks/{name}.network.json").read_text())
    mesh = span_surface(network).mesh
    _, count = unique_edges(mesh.faces)
    directed = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    assert count.max() == 2
    assert len(np.unique(directed, axis=0)) == len(directed)
    quality = mesh_quality(mesh.vertices, mesh.faces, mesh.normals)
    assert quality.euler_number == EULER[name]
    assert quality.boundary_loops == (EULER[name] == 1)
    assert quality.inverted_faces == 0
    np.testing.assert_array_equal(mesh.vertices[: len(network.points)], network.points)
