"""Built-in shapes: frames are derivatives of points, nodes really are common, the mesh is true."""

import numpy as np
import pytest
import trimesh

from tracemesh.geometry.simulated.shapes import SHAPES, Shape
from tracemesh.geometry.surfaces.cycles import trace_cycles


@pytest.fixture(params=sorted(SHAPES))
def shape(request: pytest.FixtureRequest) -> Shape:
    return SHAPES[request.param]()


def test_the_tangent_is_the_derivative_by_arc_length(shape: Shape) -> None:
    for curve in shape.curves:
        s = np.linspace(0, curve.length, 301)[1:-1]
        step = 1e-5
        slope = (curve.at(s + step)[0] - curve.at(s - step)[0]) / (2 * step)
        np.testing.assert_allclose(slope, curve.at(s)[1][:, :, 0], atol=1e-7)


def test_frames_are_rotations_with_the_surface_normal_in_the_middle(shape: Shape) -> None:
    for curve in shape.curves:
        frames = curve.at(np.linspace(0, curve.length, 50))[1]
        np.testing.assert_allclose(
            frames.transpose(0, 2, 1) @ frames, np.broadcast_to(np.eye(3), frames.shape), atol=1e-14
        )
        assert (np.linalg.det(frames) > 0).all()


def test_curves_meet_in_their_nodes(shape: Shape) -> None:
    seen: dict[int, list[np.ndarray]] = {}
    for curve in shape.curves:
        points, frames = curve.at(curve.node_positions)
        for node, point, normal in zip(curve.node_ids, points, frames[:, :, 1], strict=True):
            seen.setdefault(int(node), []).append(np.concatenate([point, normal]))
        assert (np.diff(curve.node_positions) > 0.02).all()
        assert curve.closed == (curve.node_ids[0] == curve.node_ids[-1])
    assert sorted(seen) == list(range(len(seen)))
    for rows in seen.values():
        assert len(rows) >= 2
        np.testing.assert_allclose(np.array(rows), np.broadcast_to(rows[0], (len(rows), 6)), atol=1e-9)


def test_the_network_cuts_the_surface_into_disks(shape: Shape) -> None:
    """Closed by one more face where it is open, every shape is a sphere."""
    network = shape.network(0.02)
    cycles = trace_cycles(network)
    assert len(network.nodes) - len(network.segments) + len(cycles) == 2
    openings = [c for c in cycles if all(network.segments[side.segment].boundary for side in c.sides)]
    assert len(openings) == (0 if shape.closed else 1)
    used = np.unique(np.concatenate([s.points for s in network.segments]))
    assert used.tolist() == list(range(len(network.points)))


def test_the_mesh_is_whole_oriented_and_on_the_surface(shape: Shape) -> None:
    vertices, faces = shape.mesh(24)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_winding_consistent
    assert mesh.is_watertight == shape.closed
    assert mesh.euler_number == (2 if shape.closed else 1)
    network = shape.network(0.05)
    nearest = np.argmin(np.linalg.norm(mesh.triangles_center[None] - network.points[:, None], axis=2), axis=1)
    assert np.einsum("ij,ij->i", mesh.face_normals[nearest], network.normals).min() > 0.99


def test_the_mesh_converges_to_the_surface_with_order_two(shape: Shape) -> None:
    points = shape.network(0.05).points
    errors = []
    for resolution in (12, 24, 48):
        mesh = trimesh.Trimesh(*shape.mesh(resolution), process=False)
        errors.append(np.sqrt(np.mean(trimesh.proximity.closest_point(mesh, points)[1] ** 2)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.6).all(), errors


def test_shapes_have_the_size_of_real_objects(shape: Shape) -> None:
    assert 0.4 < shape.network(0.02).diagonal < 1.1
    assert all(curve.length < 2.5 for curve in shape.curves)
