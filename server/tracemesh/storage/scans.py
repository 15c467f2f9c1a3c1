"""The scan that a session amounts to: samples as sent, everything else as edited."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import ScanError
from tracemesh.formats.recordings import Recording, scan_as_sent
from tracemesh.geometry.curves.closed_curves import begun_at_nodes
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.storage.curves import curve_rows, marks_of
from tracemesh.storage.devices import corrected_hello
from tracemesh.storage.models import CurveRow, RecordingRow
from tracemesh.storage.recordings import recording_messages
from tracemesh.storage.sessions import session_row
from tracemesh.wire.device import CurveEnd, CurveStart, NodeMark, Recorded, Samples, from_device

Blocks = dict[int, list[Samples]]
"""Sample blocks of a recording by the number of their curve."""


def load_scan(transaction: Transaction, session: str) -> tuple[Scan, list[int]]:
    """Everything scanned in a session, closed curves begun at their first node, and, for each curve of the scan, its
    index in the session. Raises what `load_sent` raises.
    """
    scan, indices = load_sent(transaction, session)
    return begun_at_nodes(scan), indices


def load_sent(transaction: Transaction, session: str) -> tuple[Scan, list[int]]:
    """The same, with every curve's samples in the order in which they were sent.

    Raises NotFound, and ScanError when there is nothing to reconstruct or a curve cannot be understood.
    """
    session_row(transaction, session)
    rows = [row for row in curve_rows(transaction, session) if row.samples]
    if not rows:
        raise ScanError(f"session {session} has no curve with samples")
    blocks = {key: sample_blocks(transaction, key) for key in {row.recording_key for row in rows}}
    recordings = [_edited(transaction, row, blocks[row.recording_key][row.number]) for row in rows]
    scan = scan_as_sent(recordings)
    curves = tuple(with_measured(c, _measured(row)) for c, row in zip(scan.curves, rows, strict=True))
    return Scan(curves), [row.index for row in rows]


def with_measured(curve: CurveScan, measured: Mapping[tuple[int, int], float]) -> CurveScan:
    """A curve as sent with those lengths (m, by first and last sample) that are between two neighbouring marks.

    A curve without marks is measured from its first sample to its last, an open one with one mark on both sides of it.
    """
    lengths = np.array([measured.get(pair, np.nan) for pair in pairwise(_segment_ends(curve))])
    return curve if np.isnan(lengths).all() else replace(curve, lengths=lengths)


def _segment_ends(curve: CurveScan) -> list[int]:
    samples: list[int] = curve.node_samples.tolist()
    if not samples or (len(samples) == 1 and not curve.closed):
        return [0, *samples, len(curve.distance) - 1]
    returns = len(samples) > 1 and curve.node_ids[0] == curve.node_ids[-1]
    return samples + samples[:1] if curve.closed and not returns else samples


def _measured(row: CurveRow) -> dict[tuple[int, int], float]:
    return {(entry["first"], entry["last"]): entry["length"] for entry in row.lengths}


def sample_blocks(transaction: Transaction, key: int) -> Blocks:
    """Sample blocks of a recording, in order."""
    found: Blocks = defaultdict(list)
    for payload in recording_messages(transaction, key):
        message = from_device.validate_json(payload)
        if isinstance(message, Samples):
            found[message.curve].append(message)
    return found


def _edited(transaction: Transaction, row: CurveRow, blocks: list[Samples]) -> Recording:
    """A recording of one curve alone."""
    recording = transaction.get_one(RecordingRow, row.recording_key)
    messages: list[Recorded] = [
        CurveStart(seq=0, curve=0, boundary=row.boundary),
        *blocks,
        *(NodeMark(seq=0, curve=0, sample=m.sample, node=m.node) for m in marks_of(transaction, row)),
        CurveEnd(seq=0, curve=0, closed=row.closed),
    ]
    numbered = [message.model_copy(update={"seq": seq, "curve": 0}) for seq, message in enumerate(messages)]
    return Recording(corrected_hello(transaction, recording), numbered)
