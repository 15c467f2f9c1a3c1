"""Validation of a curve network as the cell complex that a surface needs (thesis definition 2.31).

Every error names a segment by the nodes at its ends ("segment 3-7 of curve 1") and says what would mend it.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from tracemesh.errors import NetworkError
from tracemesh.geometry.network import CurveNetwork, Ints, Segment
from tracemesh.geometry.scan import curve_name
from tracemesh.geometry.surfaces.bridges import loops_of_faces
from tracemesh.geometry.surfaces.cycles import Cycle, loop_points, trace_cycles

# An opening seen from outside turns by -2 pi if the surface around it is flat, and by more the more it curves inwards.
# Below this, rad, a cycle of an untagged network is taken for an opening: a face would need more curvature than a
# sphere's half.
OPENING_TURN = -0.5
UNIT_TOLERANCE = 1e-3


@dataclass(frozen=True)
class CellComplex:
    """A network whose every segment bounds one face (boundary) or two.

    network: as given, with inferred boundary tags. faces: cycles to be spanned. groups: of faces, by index, that are
    the loops of one face, two or more. openings: cycles that stay open.
    inferred: whether the boundary was found instead of given.
    """

    network: CurveNetwork
    faces: tuple[Cycle, ...]
    groups: tuple[tuple[int, ...], ...]
    openings: tuple[Cycle, ...]
    inferred: bool

    def resampled(self, network: CurveNetwork) -> "CellComplex":
        """The same complex over a network whose segments have other points."""
        faces = tuple(replace(face, points=loop_points(network, face.sides)) for face in self.faces)
        return replace(self, network=network, faces=faces)


@dataclass(frozen=True)
class Fault:
    """What keeps a network from being a cell complex.

    segment: its index. end: 0 or -1, the end of the segment that it is at; None: all of it. mend: what would mend it,
    said of the segment: "boundary" or "interior"; None: nothing so simple.
    """

    message: str
    segment: int
    end: int | None = None
    mend: str | None = None


def cell_complex(network: CurveNetwork) -> CellComplex:
    """The faces and openings of a network.

    Raises NetworkError, naming the segment, if the arrays are malformed, a segment dangles, or the boundary tags
    contradict
    the faces. If no segment is tagged as boundary, cycles that turn clockwise are taken for openings.
    """
    _check_arrays(network)
    _check_segments(network)
    _refuse(_loose_ends(network))
    complex_, pieces = _traced(network)
    _refuse(_wrong_tags(complex_) or _apart(complex_, pieces))
    return complex_


def find_faults(network: CurveNetwork) -> list[Fault]:
    """All that keeps a network from being a cell complex, so that it can be shown where it is; empty if it is one.

    Raises NetworkError if the arrays are malformed.
    """
    _check_arrays(network)
    _check_segments(network)
    if loose := _loose_ends(network):
        return loose
    complex_, pieces = _traced(network)
    return _wrong_tags(complex_) or _apart(complex_, pieces)


def _traced(network: CurveNetwork) -> tuple[CellComplex, Ints]:
    """Faces and openings as the network's tags have it, right or wrong; (segments,) the piece that each belongs to."""
    cycles = trace_cycles(network)
    pieces = _pieces(network)
    groups = loops_of_faces(network, cycles, connected=pieces.max() == 0)
    paired = {number for group in groups for number in group}
    inferred = not any(segment.boundary for segment in network.segments)
    if inferred:
        network = _with_inferred_boundary(network, [c for k, c in enumerate(cycles) if k not in paired])
        inferred = any(segment.boundary for segment in network.segments)
    openings = _openings(network, cycles, paired)
    faces = [number for number in range(len(cycles)) if number not in openings]
    place = {number: k for k, number in enumerate(faces)}
    loops = tuple(tuple(place[number] for number in group if number in place) for group in groups)
    loops = tuple(group for group in loops if len(group) > 1)
    complex_ = CellComplex(
        network, tuple(cycles[k] for k in faces), loops, tuple(cycles[k] for k in sorted(openings)), inferred
    )
    return complex_, pieces


def _refuse(faults: list[Fault]) -> None:
    if faults:
        raise NetworkError(faults[0].message)


def segment_name(network: CurveNetwork, index: int) -> str:
    """A segment as a person finds it: the numbers of its end nodes and of its curve."""
    segment, called = network.segments[index], network.node_numbers
    name = curve_name(segment.curve)
    numbers = dict(zip(network.nodes.tolist(), range(len(network.nodes)) if called is None else called, strict=True))
    if segment.points[0] == segment.points[-1] and int(segment.points[0]) not in numbers:
        return f"closed {name}"
    ends = [numbers.get(int(segment.points[end]), -1) for end in (0, -1)]
    first, last = ("?" if number < 0 else number for number in ends)
    return f"segment {first}-{last} of {name}"


def _check_arrays(network: CurveNetwork) -> None:
    points, normals = network.points, network.normals
    if points.ndim != 2 or points.shape[1:] != (3,) or normals.shape != points.shape:
        raise NetworkError(f"wanted points and normals of one shape (n, 3), got {points.shape} and {normals.shape}")
    if not network.segments:
        raise NetworkError("the network has no segments: there is nothing to span a surface over")
    for name, array in (("position", points), ("normal", normals)):
        bad = np.flatnonzero(~np.isfinite(array).all(1))
        if len(bad):
            raise NetworkError(f"the {name} of point {bad[0]} is not finite: {array[bad[0]].tolist()}")
    off = np.flatnonzero(np.abs(np.linalg.norm(normals, axis=1) - 1) > UNIT_TOLERANCE)
    if len(off):
        raise NetworkError(f"the normal of point {off[0]} has length {np.linalg.norm(normals[off[0]]):.4g}, wanted 1")


def _check_segments(network: CurveNetwork) -> None:
    """Indices in range, no zero-length edge, and no two segments that share a point inside."""
    count = len(network.points)
    uses = np.zeros(count, np.int64)
    for index, segment in enumerate(network.segments):
        points = segment.points
        if len(points) < 2 or points.min() < 0 or points.max() >= count:
            raise NetworkError(
                f"segment number {index}: wanted two or more point indices below {count}, got {points.tolist()[:8]}"
            )
        closed = points[0] == points[-1]
        if closed and len(points) < 4:
            raise NetworkError(
                f"{segment_name(network, index)} closes after {len(points) - 1} points, wanted three or more"
            )
        lengths = np.linalg.norm(np.diff(network.points[points], axis=0), axis=1)
        if not lengths.all():
            raise NetworkError(
                f"{segment_name(network, index)} repeats a position at point {points[int(lengths.argmin())]}: remove it"
            )
        np.add.at(uses, points[1:-1], 1)
    ends = np.unique([segment.points[[0, -1]] for segment in network.segments])
    uses[ends] += 1
    if len(stray := np.flatnonzero(uses != 1)):
        word = (
            "belongs to no segment"
            if uses[stray[0]] == 0
            else "lies on two segments without being an end of both: mark a node there"
        )
        raise NetworkError(f"point {stray[0]} {word}")


def _loose_ends(network: CurveNetwork) -> list[Fault]:
    """Ends of segments that meet no other one."""
    ends = np.array([segment.points[[0, -1]] for segment in network.segments])
    degree = np.bincount(ends.ravel(), minlength=len(network.points))
    return [
        Fault(
            f"{segment_name(network, int(index))} {'ends' if end else 'begins'} where no other curve meets it: "
            "mark the node where it should, or remove it",
            int(index),
            -1 if end else 0,
        )
        for index, end in np.argwhere(degree[ends] == 1)
    ]


def _with_inferred_boundary(network: CurveNetwork, cycles: list[Cycle]) -> CurveNetwork:
    outer = {side.segment for cycle in cycles if cycle.turning < OPENING_TURN for side in cycle.sides}
    segments = tuple(
        Segment(segment.points, index in outer, segment.curve) for index, segment in enumerate(network.segments)
    )
    return replace(network, segments=segments)


def _pieces(network: CurveNetwork) -> Ints:
    """(number of segments,) number of the connected piece of curves that a segment belongs to."""
    count = len(network.points)
    ends = np.array([(segment.points[0], segment.points[-1]) for segment in network.segments])
    graph = sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    labels = csgraph.connected_components(graph, directed=False)[1][ends[:, 0]]
    return np.unique(labels, return_inverse=True)[1]


def _openings(network: CurveNetwork, cycles: tuple[Cycle, ...], paired: set[int]) -> set[int]:
    """Cycles along boundary segments only. Of the two sides of a lone closed boundary curve, the one that faces no
    other
    curve, or else the one that turns less.
    """
    candidates = [
        number for number, c in enumerate(cycles) if all(network.segments[side.segment].boundary for side in c.sides)
    ]
    openings: set[int] = set()
    taken: set[int] = set()
    for number in sorted(candidates, key=lambda k: (k in paired, cycles[k].turning)):
        segments = {side.segment for side in cycles[number].sides}
        if taken.isdisjoint(segments):
            openings.add(number)
            taken |= segments
    return openings


def _apart(complex_: CellComplex, pieces: Ints) -> list[Fault]:
    """Pieces of the network that no face with several loops joins to the first one."""
    pairs = [
        [pieces[complex_.faces[k].sides[0].segment] for k in (group[0], other)]
        for group in complex_.groups
        for other in group[1:]
    ]
    first, second = np.array(pairs, np.int64).reshape(-1, 2).T
    size = int(pieces.max()) + 1
    graph = sparse.coo_matrix((np.ones(len(first)), (first, second)), (size, size))
    joined = csgraph.connected_components(graph, directed=False)[1]
    network, here = complex_.network, segment_name(complex_.network, int(np.argmax(pieces == 0)))
    lone = [int(np.argmax(joined[pieces] == group)) for group in np.unique(joined) if group != joined[0]]
    return [
        Fault(f"no curve and no face connects {here} and {segment_name(network, s)}: connect them by a curve", s)
        for s in lone
    ]


def _wrong_tags(complex_: CellComplex) -> list[Fault]:
    """Boundary segments that do not bound one face, others that do not bound two."""
    network, count = complex_.network, np.zeros(len(complex_.network.segments), np.int64)
    for face in complex_.faces:
        np.add.at(count, [side.segment for side in face.sides], 1)
    wanted = np.array([1 if segment.boundary else 2 for segment in network.segments])
    faults = [fault for index in np.flatnonzero(count != wanted) for fault in _told(complex_, int(index))]
    return list(dict.fromkeys(faults))


def _told(complex_: CellComplex, index: int) -> list[Fault]:
    """What is wrong about a boundary segment with faces on both sides.

    It usually means that another stretch of the same opening is not tagged.
    """
    network = complex_.network
    beside = (face for face in complex_.faces if any(side.segment == index for side in face.sides))
    around = min(beside, key=lambda face: face.turning)
    untagged = [side.segment for side in around.sides if not network.segments[side.segment].boundary]
    if around.turning < OPENING_TURN and untagged:
        said = "lies beside an opening and belongs to one face only: mark it as boundary?"
        return [Fault(f"{segment_name(network, s)} {said}", s, mend="boundary") for s in untagged]
    said = "is marked as boundary but has a face on both sides: mark it as interior?"
    return [Fault(f"{segment_name(network, index)} {said}", index, mend="interior")]
