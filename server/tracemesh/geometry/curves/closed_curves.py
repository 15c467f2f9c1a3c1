"""Closed curves that begin and end at a node."""

from dataclasses import replace

import numpy as np

from tracemesh.geometry.scan import CurveScan, Ints, Scan


def sample_as_scanned(sample: int, first_mark: int, count: int) -> int:
    """Where a sample of a closed curve of `count` was before `from_first_node` made it begin at `first_mark`."""
    after = first_mark + sample
    return after if after < count else after - count + 1


def as_scanned(curve: CurveScan, samples: Ints) -> Ints:
    """Samples (n,) of a curve's `from_first_node` as the curve itself counts them."""
    if not curve.closed or from_first_node(curve) is curve:
        return samples
    count = len(curve.distance)
    after = samples + curve.node_samples[0]
    scanned: Ints = np.where(after < count, after, after - count + 1)
    return scanned


def begun_at_nodes(scan: Scan) -> Scan:
    """The scan with every closed curve going from its first node to the same node."""
    return Scan(tuple(from_first_node(curve) if curve.closed else curve for curve in scan.curves))


def from_first_node(curve: CurveScan) -> CurveScan:
    """A closed curve that goes from its first node around to the same node, wherever its measurement began.

    One that does so already, or has no node, is returned as it is.
    """
    ids = curve.node_ids
    if len(ids) == 0 or (len(ids) > 1 and ids[0] == ids[-1]):
        return curve
    start, count = int(curve.node_samples[0]), len(curve.distance)
    order = np.concatenate([np.arange(start, count), np.arange(1, start + 1)])
    lap = np.where(np.arange(count) < count - start, 0.0, curve.distance[-1] - curve.distance[0])
    return replace(
        curve,
        distance=curve.distance[order] + lap,
        tangent=curve.tangent[order],
        normal=curve.normal[order],
        node_samples=np.append(curve.node_samples - start, count - 1),
        node_ids=np.append(ids, ids[0]),
        acceleration=None if curve.acceleration is None else curve.acceleration[order],
        magnetic=None if curve.magnetic is None else curve.magnetic[order],
        time=None if curve.time is None else curve.time[order],
    )
