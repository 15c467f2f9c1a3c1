"""A session in a few lines, small enough for a list of many: as reconstructed, else as reckoned from what was sent."""

import numpy as np
from sqlalchemy.orm import Session as Transaction

from tracemesh.api.live.drawing import flat
from tracemesh.api.live.tracker import SessionTracker
from tracemesh.formats.networks import read_network
from tracemesh.geometry.scan import Floats
from tracemesh.storage.artifacts import ArtifactStore, artifact_row
from tracemesh.storage.sessions import get_session
from tracemesh.wire.resources import Outline, OutlineCurve

MOST_POINTS = 40
"""Points of one line."""
MOST_SAMPLES = 200_000
"""A session with more samples has no outline until it is reconstructed: nobody waits for a list."""


def outline(transaction: Transaction, store: ArtifactStore, session: str) -> Outline:
    """The lines of a session; raises NotFound."""
    known = get_session(transaction, session)
    if known.latest_reconstruction is not None:
        return _of_network(transaction, store, known.latest_reconstruction)
    if known.samples > MOST_SAMPLES:
        return Outline(curves=[])
    drawn = SessionTracker.load(transaction, session).network().curves
    return Outline(curves=[_line(c.boundary, np.reshape(c.positions, (-1, 3))) for c in drawn if c.positions])


def _of_network(transaction: Transaction, store: ArtifactStore, reconstruction: str) -> Outline:
    path = store.path(artifact_row(transaction, reconstruction, "network.json").sha256)
    network = read_network(path.read_text("utf-8"))
    return Outline(curves=[_line(s.boundary, network.points[s.points]) for s in network.segments])


def _line(boundary: bool, points: Floats) -> OutlineCurve:
    chosen = np.unique(np.linspace(0, len(points) - 1, min(len(points), MOST_POINTS)).round().astype(int))
    return OutlineCurve(boundary=boundary, positions=flat(points[chosen]))
