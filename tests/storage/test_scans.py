"""The scan that a session amounts to."""

from pathlib import Path

import numpy as np
import pytest

from tracemesh.errors import NotFound, ScanError
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import recording_from_scan
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.storage.curves import list_curves, update_curve
from tracemesh.storage.database import Database
from tracemesh.storage.ingest import Group, commit, open_recording
from tracemesh.storage.scans import load_scan
from tracemesh.storage.sessions import create_session
from tracemesh.wire.resources import CurveUpdate, Mark, SessionCreate


def store(database: Database, scan: Scan, recording: str) -> None:
    sent = recording_from_scan(scan, recording, "s")
    with database.write() as transaction:
        state = open_recording(transaction, sent.hello, sent.hello.model_dump_json().encode())
        group = Group()
        for message in sent.messages:
            state.check(message)
            state.advance(message, 1)
            group.add(state, message, message.model_dump_json(exclude_none=True).encode())
        commit(transaction, group)


@pytest.fixture
def scan(shared_data: Path) -> Scan:
    """The author.s own scan."""
    return read_rawnet((shared_data / "lilium.rawnet").read_text())


def same(one: CurveScan, two: CurveScan) -> bool:
    arrays = ("distance", "tangent", "normal", "node_samples", "node_ids")
    flags = (one.boundary, one.closed) == (two.boundary, two.closed)
    return flags and all(np.array_equal(getattr(one, a), getattr(two, a)) for a in arrays)


def test_what_goes_in_comes_out(database: Database, scan: Scan) -> None:
    """Two recordings in one session: their curves follow each other, bit for bit."""
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
    store(database, scan, "one")
    store(database, scan, "two")
    with database.read() as transaction:
        loaded, indices = load_scan(transaction, "s")
    assert indices == list(range(2 * len(scan.curves)))
    assert all(same(a, b) for a, b in zip(loaded.curves, scan.curves * 2, strict=True))


def test_edits_are_what_is_reconstructed(database: Database, scan: Scan) -> None:
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
    store(database, scan, "one")
    with database.write() as transaction:
        update_curve(transaction, "s", 0, CurveUpdate(removed=True))
        marks = [Mark(sample=7, node=3), Mark(sample=2, node=5)]
        boundary = not scan.curves[1].boundary
        update_curve(transaction, "s", 1, CurveUpdate(boundary=boundary, closed=False, marks=marks))
        loaded, indices = load_scan(transaction, "s")
        assert list_curves(transaction, "s")[0].marks == marks[::-1]
    assert indices == list(range(1, len(scan.curves)))
    edited = loaded.curves[0]
    assert edited.boundary == boundary
    assert edited.node_samples.tolist() == [2, 7]
    assert edited.node_ids.tolist() == [5, 3]
    assert np.array_equal(edited.tangent, scan.curves[1].tangent)
    assert same(loaded.curves[1], scan.curves[2])


def test_nothing_to_reconstruct_is_said(database: Database) -> None:
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="s"))
        with pytest.raises(ScanError, match="no curve with samples"):
            load_scan(transaction, "s")
        with pytest.raises(NotFound):
            load_scan(transaction, "t")
