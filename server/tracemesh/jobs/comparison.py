"""How far a reconstructed surface is from a true one, in a process of its own; it tells how far it is."""

from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from tracemesh.wire.resources import Comparison

if TYPE_CHECKING:
    from tracemesh.geometry.comparison.evaluation import Alignment

PAUSE = 0.1
"""s between two words of progress."""


@dataclass(frozen=True)
class Truth:
    """A mesh file as it came; name: with the extension that tells its format."""

    name: str
    content: bytes


def compare(mesh: Path, truth: Truth, align: "Alignment", words: "Connection[tuple[str, float], None]") -> Comparison:
    """Compare a GLB file with the truth; (stage, fraction) is sent to `words`,
    first when both are read. Raises InputError."""
    from tracemesh.formats.meshes import read_mesh
    from tracemesh.geometry.comparison.evaluation import evaluate, vertex_normals

    tell = _every_now_and_then(words)
    true_vertices, true_faces = read_mesh(truth.content, Path(truth.name).suffix.lstrip("."), truth.name)
    vertices, faces = read_mesh(mesh.read_bytes(), "glb")
    tell("registering", 0.0)
    normals = vertex_normals(vertices, faces)
    found = evaluate(vertices, normals, true_vertices, true_faces, align, lambda part: tell("registering", part))
    return Comparison(
        mean=found.mean,
        rms=found.rms,
        max=found.max,
        min=found.min,
        normal_deg=found.normal_deg,
        diagonal=found.diagonal,
        rotation=found.placement.rotation.tolist(),
        translation=found.placement.translation.tolist(),
        scale=found.placement.scale,
        signed_distance=found.signed.tolist(),
    )


def _every_now_and_then(words: "Connection[tuple[str, float], None]") -> Callable[[str, float], None]:
    last = -PAUSE

    def tell(stage: str, fraction: float) -> None:
        nonlocal last
        if monotonic() - last >= PAUSE:
            last = monotonic()
            words.send((stage, fraction))

    return tell
