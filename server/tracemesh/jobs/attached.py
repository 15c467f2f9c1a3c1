"""The network of a scan under way: whatever hangs together of it, solved over all of its curves at once.

The solver is imported where it runs: the server itself stays small and starts at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.closed_curves import as_scanned, begun_at_nodes
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.scan import CurveScan, Floats, Ints, Scan
from tracemesh.jobs.numbering import numbered
from tracemesh.storage.curves import curve_rows
from tracemesh.storage.database import Database
from tracemesh.storage.scans import load_sent

if TYPE_CHECKING:
    from tracemesh.geometry.curves.network_report import Misfit
    from tracemesh.geometry.curves.reconstruction import NetworkResult


@dataclass(frozen=True)
class SolvedCurve:
    """positions: (n, 3) m, world, from the curve's beginning to its sample `last_sample`. samples: (n,) the sample, as
    sent, that each of them is nearest to.
    """

    positions: Floats
    samples: Ints
    last_sample: int


@dataclass(frozen=True)
class SolvedNetwork:
    """Curves by their index in the session, nodes (3,) m by their number."""

    curves: dict[int, SolvedCurve]
    nodes: dict[int, Floats]
    misfits: "tuple[Misfit, ...]"
    report: dict[str, object]
    network: CurveNetwork


def solve_attached(database_url: str, session: str) -> SolvedNetwork | None:
    """The largest part of a session's curves that hangs together by nodes; None while there is nothing to solve."""
    database = Database(database_url)
    try:
        with database.read() as transaction:
            scan, indices = load_sent(transaction, session)
            ended = {row.index for row in curve_rows(transaction, session) if row.ended}
        ready = [i for i, c in enumerate(scan.curves) if len(c.node_samples) > 1 or indices[i] in ended]
        chosen = largest_piece(scan.curves, ready)
        piece = Scan(tuple(scan.curves[i] for i in chosen))
        return solve_network(piece, [indices[i] for i in chosen]) if chosen else None
    except ScanError:
        return None
    finally:
        database.close()


def largest_piece(curves: Sequence[CurveScan], candidates: Sequence[int]) -> list[int]:
    """Those of the candidates that hang together by shared nodes; the most samples win, then the earliest curve."""
    pieces: list[tuple[set[int], list[int]]] = []
    for i in candidates:
        nodes = set(curves[i].node_ids.tolist())
        joined = [piece for piece in pieces if piece[0] & nodes]
        pieces = [piece for piece in pieces if not piece[0] & nodes]
        pieces.append((nodes.union(*(p[0] for p in joined)), sorted([i, *(j for p in joined for j in p[1])])))
    members = [piece[1] for piece in pieces]
    return max(members, key=lambda piece: (sum(len(curves[i].distance) for i in piece), -piece[0]), default=[])


def solve_network(scan: Scan, indices: Sequence[int]) -> SolvedNetwork:
    """The network of a scan, as it was sent, whose curves have these indices in the session; raises ScanError."""
    from tracemesh.geometry.curves.reconstruction import reconstruct_network

    begun = begun_at_nodes(scan)
    with numbered(indices):
        return solved_network(scan, begun, indices, reconstruct_network(begun))


def solved_network(scan: Scan, begun: Scan, indices: Sequence[int], result: "NetworkResult") -> SolvedNetwork:
    """A network by the indices of its curves in the session, and the numbers of its nodes.

    The scan as it was sent, and as it was solved, with closed curves begun at their nodes.
    """
    network = result.network
    numbers = np.unique(np.concatenate([curve.node_ids for curve in scan.curves]))
    curves = {
        index: _solved(network, i, curve, sent)
        for i, (index, curve, sent) in enumerate(zip(indices, begun.curves, scan.curves, strict=True))
    }
    nodes = {int(n): network.points[p] for n, p in zip(numbers, network.nodes, strict=False)}
    return SolvedNetwork(curves, nodes, result.misfits, result.report, network)


def _solved(network: CurveNetwork, index: int, curve: CurveScan, sent: CurveScan) -> SolvedCurve:
    """One curve from its beginning to its end."""
    parts = [network.points[segment.points] for segment in network.segments if segment.curve == index]
    positions = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
    return SolvedCurve(positions, as_scanned(sent, _samples_along(parts, curve)), _last_sample(curve))


def _samples_along(parts: Sequence[Floats], curve: CurveScan) -> Ints:
    """The sample (n,) where as much of its segment was travelled as at each point of a curve's segments."""
    last = len(curve.distance) - 1
    for ends in (curve.node_samples, np.unique([0, *curve.node_samples, last])):
        if len(ends) == len(parts) + 1:
            found = [_samples_of(part, curve.distance, a, b) for part, a, b in zip(parts, ends, ends[1:], strict=False)]
            return np.concatenate([found[0], *(samples[1:] for samples in found[1:])])
    return _samples_of(np.concatenate([parts[0], *(part[1:] for part in parts[1:])]), curve.distance, 0, last)


def _samples_of(points: Floats, distance: Floats, first: int, last: int) -> Ints:
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    travelled = np.maximum.accumulate(distance[first : last + 1] - distance[first])
    wanted = arc / max(arc[-1], np.finfo(float).tiny) * travelled[-1]
    samples: Ints = first + np.rint(np.interp(wanted, travelled, np.arange(len(travelled)))).astype(np.int64)
    samples[[0, -1]] = first, last
    return samples


def _last_sample(curve: CurveScan) -> int:
    """The last sample that the network holds: an open curve is cut at its last node, if it has two."""
    whole = curve.closed or len(curve.node_samples) < 2
    return len(curve.distance) - 1 if whole else int(curve.node_samples[-1])
