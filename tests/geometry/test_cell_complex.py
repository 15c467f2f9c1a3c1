"""Every network that is no cell complex is refused by naming the culprit; every other one is traced the same
however it is written.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.geometry.network_fixtures import octants, radial, rings, sideways, window
from tracemesh.errors import NetworkError
from tracemesh.geometry.curves.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.network import CurveNetwork, Segment
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import exact_scan
from tracemesh.geometry.surfaces.cell_complex import cell_complex
from tracemesh.geometry.surfaces.cycles import geodesic_turning, trace_cycles
from tracemesh.geometry.surfaces.subdivision import subdivided


def flat_window(parts: int = 4) -> CurveNetwork:
    return window(parts, lambda x, y: (0 * x, 0 * x, 0 * x))


def with_segment(network: CurveNetwork, index: int, **changes: object) -> CurveNetwork:
    segments = list(network.segments)
    segments[index] = replace(segments[index], **changes)  # type: ignore[arg-type]
    return replace(network, segments=tuple(segments))


def test_every_side_of_every_segment_is_in_one_cycle() -> None:
    for network in (octants(0.2), flat_window()):
        sides = [side for cycle in trace_cycles(network) for side in cycle.sides]
        assert len(sides) == len(set(sides)) == 2 * len(network.segments)


def test_turning_of_an_octant_is_two_pi_minus_its_curvature() -> None:
    cycles = trace_cycles(octants(0.02))
    np.testing.assert_allclose([cycle.turning for cycle in cycles], 2 * np.pi - np.pi / 2, atol=1e-9)


def test_turning_of_a_flat_loop_is_two_pi_either_way() -> None:
    turn = np.linspace(0, 2 * np.pi, 20)[:-1]
    loop = np.column_stack([np.cos(turn), 0.3 * np.sin(turn), 0 * turn])
    normals = np.tile([0.0, 0, 1], (len(loop), 1))
    assert geodesic_turning(loop, normals) == pytest.approx(2 * np.pi)
    assert geodesic_turning(loop[::-1], normals) == pytest.approx(-2 * np.pi)


def test_faces_do_not_depend_on_order_and_direction_of_segments() -> None:
    network = flat_window()
    shuffled = replace(
        network, segments=tuple(replace(s, points=s.points[::-1].copy()) for s in reversed(network.segments))
    )

    def faces(n: CurveNetwork) -> set[frozenset[int]]:
        return {frozenset(face.points.tolist()) for face in cell_complex(n).faces}

    assert faces(network) == faces(shuffled)
    assert len(faces(network)) == 4


def test_untagged_boundary_is_found() -> None:
    network = flat_window()
    untagged = replace(network, segments=tuple(replace(s, boundary=False) for s in network.segments))
    complex_ = cell_complex(untagged)
    assert complex_.inferred
    assert [s.boundary for s in complex_.network.segments] == [s.boundary for s in network.segments]


def test_closed_surface_needs_no_boundary() -> None:
    complex_ = cell_complex(octants(0.2))
    assert not complex_.inferred
    assert len(complex_.faces) == 8
    assert not complex_.openings


def test_forgotten_boundary_tag_names_the_segment() -> None:
    with pytest.raises(NetworkError, match=r"segment 1-2 of curve 1 lies beside an opening.*mark it as boundary"):
        cell_complex(with_segment(flat_window(), 1, boundary=False))


def test_wrong_boundary_tag_names_the_segment() -> None:
    with pytest.raises(NetworkError, match=r"segment 1-4 of curve 2 is marked as boundary.*mark it as interior"):
        cell_complex(with_segment(flat_window(), 8, boundary=True))


def test_dangling_segment_is_named() -> None:
    network = flat_window(1)
    with pytest.raises(NetworkError, match="segment 4-5 of curve 3 begins where no other curve meets it"):
        cell_complex(replace(network, segments=(*network.segments[:8], network.segments[11])))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda n: replace(n, segments=()), "no segments"),
        (lambda n: replace(n, normals=n.normals[:-1]), "one shape"),
        (lambda n: replace(n, normals=2 * n.normals), "has length 2, wanted 1"),
        (lambda n: replace(n, points=np.vstack([n.points[:7], n.points[7:] * np.nan])), "position of point 7 is"),
        (lambda n: replace(n, points=n.points[[*range(45), 0]], normals=n.normals[[*range(45), 0]]), "no segment"),
        (lambda n: with_segment(n, 0, points=np.array([0, 1000])), "point indices below"),
        (lambda n: with_segment(n, 0, points=np.array([0, 9, 10, 0])), "belongs to no segment|where no other"),
        (lambda n: with_segment(n, 0, points=np.array([0, 9, 9, 10, 11, 1])), "repeats a position"),
    ],
)  # fmt: skip
def test_malformed_networks_are_refused(change: object, message: str) -> None:
    with pytest.raises(NetworkError, match=message):
        cell_complex(change(flat_window()))  # type: ignore[operator]


def test_two_segments_that_share_a_point_inside_need_a_node() -> None:
    network = flat_window()
    crossing = Segment(np.array([0, int(network.segments[8].points[2]), 8]), False, 3)
    with pytest.raises(NetworkError, match="mark a node there"):
        cell_complex(replace(network, segments=(*network.segments, crossing)))


def test_rings_are_paired_across_the_band_between_them() -> None:
    band = cell_complex(rings([(1, 0, True), (1, 2, True)], sideways))
    assert band.groups == ((0, 1),)
    assert len(band.openings) == 2
    globe = cell_complex(rings([(np.cos(0.5), np.sin(-0.5), False), (np.cos(0.5), np.sin(0.5), False)], radial))
    assert len(globe.faces) == 4
    assert len(globe.groups) == 1


def test_curves_that_nothing_connects_are_named() -> None:
    with pytest.raises(NetworkError, match="closed curve 1 and closed curve 2: connect them"):
        cell_complex(rings([(1, 0, False), (1, 50, False)], radial))


def test_nodes_are_named_as_the_scan_names_them() -> None:
    scan = exact_scan(SHAPES["leaf"](), 0.01)
    called = Scan(tuple(replace(c, node_ids=10 * c.node_ids + 7, boundary=i == 1) for i, c in enumerate(scan.curves)))
    network = reconstruct_network(called, NetworkParameters(step=0.03)).network
    fine = subdivided(network, 0.01)
    segment = scan.curves[1].node_ids[:2] * 10 + 7
    for told in (network, fine):
        with pytest.raises(NetworkError, match=rf"segment {segment[0]}-{segment[1]} of curve 2 is marked as boundary"):
            cell_complex(told)
