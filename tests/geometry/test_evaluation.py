"""Evaluation: known errors are measured as what they are."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracemesh.errors import InputError
from tracemesh.formats.meshes import read_mesh
from tracemesh.formats.networks import read_network
from tracemesh.geometry.comparison.evaluation import evaluate, hausdorff_distance, vertex_normals
from tracemesh.geometry.simulated.shapes import SHAPES, leaf

PLATE = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def test_figures_are_percent_of_the_diagonal() -> None:
    found = evaluate(np.array([[1.0, 1, 0.1], [2, 2, -0.3], [1, 3, 0.0], [1, 2, 0.2]]), None, *PLATE)
    assert found.diagonal == 5
    assert (found.mean, found.max, found.min) == pytest.approx((3.0, 6.0, 0.0))
    assert found.rms == pytest.approx(100 / 5 * np.sqrt((0.01 + 0.09 + 0.04) / 4))
    assert found.normal_deg is None
    assert found.summary()["unit"] == "percent of the truth's diagonal"
    assert "3.0000 %" in found.text()


def test_normals_are_compared_with_the_true_ones() -> None:
    tilted = np.array([[0, np.sin(0.1), np.cos(0.1)], [0.0, 0, -1]])
    found = evaluate(np.array([[1.0, 1, 0], [2, 2, 0]]), tilted, *PLATE)
    assert found.normal_deg == pytest.approx((np.degrees(0.1) + 180) / 2)
    assert "degrees" in found.text()


@pytest.mark.parametrize("align", ["rigid", "similarity"])
def test_aligning_undoes_a_motion_of_points_and_normals(align: str) -> None:
    shape = leaf()
    network = shape.network(0.05)
    turn = Rotation.from_rotvec([0.4, -0.8, 1.0])
    scale = 1.0 if align == "rigid" else 1.7
    points = scale * turn.apply(network.points) + [3, 2, 1]
    truth = shape.mesh(48)
    still = evaluate(network.points, network.normals, *truth)
    moved = evaluate(points, turn.apply(network.normals), *truth, align=align)  # type: ignore[arg-type]
    assert moved.mean <= still.mean * 1.01
    assert moved.normal_deg == pytest.approx(still.normal_deg, abs=0.1)
    assert evaluate(points, None, *truth).mean > 50


def test_exact_networks_are_on_their_truth(shared_data: Path) -> None:
    truth = read_mesh((shared_data / "lilium.obj").read_bytes(), "obj")
    network = read_network((shared_data / "networks/lilium-5.network.json").read_text())
    assert evaluate(network.points, None, *truth).max < 1e-3


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_vertex_normals_converge_to_the_surfaces(name: str) -> None:
    shape = SHAPES[name]()
    network = shape.network(0.1)
    errors = [evaluate(network.points, network.normals, *shape.mesh(n)).normal_deg for n in (16, 64)]
    assert errors[1] is not None
    assert errors[0] is not None
    assert errors[1] < 0.7 * errors[0]


def test_hausdorff_looks_both_ways() -> None:
    vertices, faces = PLATE
    smaller = vertices * [0.5, 1, 1]
    assert hausdorff_distance(smaller, faces, vertices, faces) == pytest.approx(1.5)
    assert hausdorff_distance(vertices, faces, smaller, faces) == pytest.approx(1.5)
    assert hausdorff_distance(vertices, faces, vertices + np.array([0, 0, 0.25]), faces) == pytest.approx(0.25)


def test_vertex_normals_of_a_plate_are_its_own() -> None:
    assert vertex_normals(*PLATE).tolist() == [[0, 0, 1]] * 4


def test_nothing_cannot_be_evaluated() -> None:
    with pytest.raises(InputError, match="at least one point"):
        evaluate(np.empty((0, 3)), None, *PLATE)
