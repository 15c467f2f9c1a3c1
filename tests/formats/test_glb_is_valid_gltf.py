"""GLB files pass the Khronos glTF validator, which comes with the web page's development packages."""

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np

from tracemesh.formats.meshes import write_mesh
from tracemesh.geometry.comparison.evaluation import vertex_normals
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.simulated.shapes import leaf

WEB = Path(__file__).resolve().parents[2] / "web"
VALIDATE = """
const validator = require("gltf-validator");
const bytes = new Uint8Array(require("fs").readFileSync(0));
validator.validateBytes(bytes).then((report) => console.log(JSON.stringify(report)));
"""


def issues(glb: bytes) -> list[dict[str, object]]:
    """Errors and warnings (severity 0 and 1)."""
    done = subprocess.run(["node", "-e", VALIDATE], input=glb, cwd=WEB, capture_output=True, check=True)
    return [m for m in json.loads(done.stdout)["issues"]["messages"] if m["severity"] <= 1]


def written(network: bool) -> bytes:
    vertices, faces = leaf().mesh(12)
    curvature, patch = np.linspace(-1, 1, len(vertices)), np.zeros(len(faces), np.int64)
    mesh = Mesh(vertices, faces, vertex_normals(vertices, faces), curvature, curvature, patch)
    provenance: dict[str, object] = {"generator": "tracemesh", "recordings": ["a", "b"]}
    curves = leaf().network(0.05)
    curves = replace(curves, uncertainty=np.full(len(curves.points), 0.001))
    return write_mesh(mesh, "glb", curves if network else None, provenance)


def test_with_and_without_the_network() -> None:
    assert issues(written(network=True)) == []
    assert issues(written(network=False)) == []


def test_the_validator_would_see_a_fault() -> None:
    assert issues(written(network=True).replace(b'"mode":4', b'"mode":9'))
