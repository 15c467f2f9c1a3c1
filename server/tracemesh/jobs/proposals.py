"""Nodes that were found in a session, told by the session's own curves and samples."""

from collections.abc import Sequence

from tracemesh.geometry.curves.closed_curves import sample_as_scanned
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.jobs.numbering import numbered
from tracemesh.wire.resources import Curve, NodePlace, NodeProposal, NodeProposals


def propose_nodes(scan: Scan, curves: Sequence[Curve]) -> NodeProposals:
    """Nodes of a scan whose curves are these ones of a session; raises ScanError."""
    from tracemesh.geometry.nodes.node_inference import infer_nodes  # here, so that the server itself stays small

    with numbered([curve.index for curve in curves]):
        found = infer_nodes(scan)
    proposals = [
        NodeProposal(
            places=[
                NodePlace(curve=curves[i].index, sample=_as_sent(scan.curves[i], curves[i], s)) for i, s in p.places
            ],
            confidence=p.confidence,
            node=p.node,
        )
        for p in found.proposals
    ]
    return NodeProposals(proposals=proposals, unplaced=[curves[i].index for i in found.unplaced])


def _as_sent(scanned: CurveScan, curve: Curve, sample: int) -> int:
    """Number of a sample within the curve as it was sent; a closed curve of the scan begins at its first mark."""
    marks = sorted((m.sample, m.node) for m in curve.marks)
    if not curve.closed or not marks or (len(marks) > 1 and marks[0][1] == marks[-1][1]):
        return sample
    return sample_as_scanned(sample, marks[0][0], len(scanned.distance))
