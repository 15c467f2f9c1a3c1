"""Nodes and segments of a session's latest network."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from fastapi import APIRouter

from tracemesh.api.paging import UsePage
from tracemesh.api.services import Reading, UseServices
from tracemesh.errors import NotFound
from tracemesh.formats.networks import read_network
from tracemesh.geometry.network import CurveNetwork, Floats, Segment
from tracemesh.storage.artifacts import artifact_row
from tracemesh.storage.sessions import get_session
from tracemesh.wire.base import Identifier, Vector
from tracemesh.wire.resources import NetworkNode, NetworkSegment

router = APIRouter(prefix="/sessions/{session}", tags=["networks"])


@router.get("/nodes")
def nodes(session: Identifier, transaction: Reading, services: UseServices, page: UsePage) -> list[NetworkNode]:
    """Where curves meet in the latest network, with the surface's normal there; 404 before the first reconstruction."""
    network = _latest(transaction, services, session)
    found = [_node(network, index) for index in range(len(network.nodes))[page.window]]
    return page.of(found, lambda node: node.index)


@router.get("/segments")
def segments(session: Identifier, transaction: Reading, services: UseServices, page: UsePage) -> list[NetworkSegment]:
    """Pieces of curves between nodes in the latest network, with their lengths; 404 before the first reconstruction."""
    network = _latest(transaction, services, session)
    found = [_segment(network, index) for index in range(len(network.segments))[page.window]]
    return page.of(found, lambda segment: segment.index)


def _latest(transaction: Reading, services: UseServices, session: str) -> CurveNetwork:
    latest = get_session(transaction, session).latest_reconstruction
    if latest is None:
        raise NotFound(f"session {session} has no network yet: reconstruct it")
    return _read(services.artifacts.path(artifact_row(transaction, latest, "network.json").sha256))


@lru_cache(maxsize=1)
def _read(path: Path) -> CurveNetwork:
    """Contents never change under their name."""
    return read_network(path.read_text("utf-8"), path.name)


def _node(network: CurveNetwork, index: int) -> NetworkNode:
    point = int(network.nodes[index])
    meeting = [k for k, segment in enumerate(network.segments) if point in (segment.points[0], segment.points[-1])]
    position, normal = (_vector(array[point]) for array in (network.points, network.normals))
    return NetworkNode(index=index, position=position, normal=normal, segments=meeting)


def _segment(network: CurveNetwork, index: int) -> NetworkSegment:
    segment: Segment = network.segments[index]
    points = network.points[segment.points]
    place = {int(point): number for number, point in enumerate(network.nodes)}
    ends = [place[end] for end in (int(segment.points[0]), int(segment.points[-1])) if end in place]
    return NetworkSegment(
        index=index,
        curve=segment.curve,
        boundary=segment.boundary,
        nodes=ends,
        points=len(points),
        length=float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()),
    )


def _vector(row: Floats) -> Vector:
    x, y, z = (float(value) for value in row)
    return x, y, z
