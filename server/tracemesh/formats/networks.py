"""Network JSON (`*.network.json`): a curve network with positions and normals; described in docs/formats.md."""

import json
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tracemesh.errors import InputError
from tracemesh.geometry.network import CurveNetwork, Floats, Ints, Segment

_UNIT_TOLERANCE = 1e-3


class _SegmentModel(BaseModel):
    model_config = ConfigDict(strict=True)
    points: list[int] = Field(min_length=2)
    boundary: bool = False
    curve: int = Field(default=0, ge=0)


class _NetworkModel(BaseModel):
    model_config = ConfigDict(allow_inf_nan=False)
    format: str = Field(pattern="^tracemesh-network$")
    version: int = Field(ge=1, le=1)
    unit: str = Field(default="m", pattern="^m$")
    points: list[tuple[float, float, float]] = Field(min_length=2)
    normals: list[tuple[float, float, float]]
    nodes: list[int]
    segments: list[_SegmentModel] = Field(min_length=1)
    uncertainty: list[Annotated[float, Field(ge=0)]] | None = None


def read_network(text: str, source: str = "") -> CurveNetwork:
    """Network held by a JSON text; raises InputError that names `source`, the entry, what was wanted and what came."""
    prefix = f"{source}: " if source else ""
    try:
        model = _NetworkModel.model_validate_json(text)
    except ValidationError as error:
        raise InputError(prefix + _told(error)) from None
    fault = next(_faults(model), None)
    if fault:
        raise InputError(prefix + fault)
    segments = tuple(Segment(np.array(s.points, np.int64), s.boundary, s.curve) for s in model.segments)
    return CurveNetwork(
        _rows(model.points), _rows(model.normals), _integers(model.nodes), segments, _uncertainty(model)
    )


def write_network(network: CurveNetwork) -> str:
    """JSON text of which `read_network` makes the same network, bit for bit."""
    known = {} if network.uncertainty is None else {"uncertainty": network.uncertainty.tolist()}
    document = {
        "format": "tracemesh-network",
        "version": 1,
        "unit": "m",
        "points": network.points.tolist(),
        "normals": network.normals.tolist(),
        "nodes": network.nodes.tolist(),
        "segments": [
            {"points": s.points.tolist(), "boundary": bool(s.boundary), "curve": int(s.curve)} for s in network.segments
        ],
        **known,
    }
    return json.dumps(document, allow_nan=False) + "\n"


def _uncertainty(model: _NetworkModel) -> Floats | None:
    """None also where it is not one number a point: then the points were edited by what does not know it."""
    known = model.uncertainty is not None and len(model.uncertainty) == len(model.points)
    return np.array(model.uncertainty, np.float64) if known else None


def _faults(model: _NetworkModel) -> Iterator[str]:
    """What the types cannot say, the first fault first."""
    count = len(model.points)
    if len(model.normals) != count:
        yield f"normals: wanted one for each of the {count} points, got {len(model.normals)}"
        return
    off = np.abs(np.linalg.norm(_rows(model.normals), axis=1) - 1)
    if off.max() > _UNIT_TOLERANCE:
        yield f"normals[{off.argmax()}]: wanted length 1, off by {off.max():.3g}"
    if len(set(model.nodes)) != len(model.nodes):
        yield "nodes: wanted every node once, got one repeated"
    yield from _bad_indices("nodes", model.nodes, count)
    nodes = set(model.nodes)
    for number, segment in enumerate(model.segments):
        yield from _segment_faults(f"segments[{number}].points", segment.points, count, nodes)


def _segment_faults(name: str, points: list[int], count: int, nodes: set[int]) -> Iterator[str]:
    yield from _bad_indices(name, points, count)
    if any(a == b for a, b in pairwise(points)):
        yield f"{name}: wanted a polyline, got the same point twice in a row"
    if points[0] != points[-1] and not {points[0], points[-1]} <= nodes:
        yield f"{name}: wanted a node at both ends, got {points[0]} and {points[-1]}"


def _bad_indices(name: str, indices: list[int], count: int) -> Iterator[str]:
    for position, index in enumerate(indices):
        if not 0 <= index < count:
            yield f"{name}[{position}]: wanted an index from 0 to {count - 1}, got {index}"


def _told(error: ValidationError) -> str:
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        return f"wanted a curve network in JSON: {first['msg']}"
    where = ".".join(str(part) for part in first["loc"])
    came = "" if first["type"] == "missing" else f", got {str(first['input'])[:60]!r}"
    return f"{where + ': ' if where else ''}{first['msg']}{came}"


def _rows(rows: list[tuple[float, float, float]]) -> Floats:
    return np.array(rows, np.float64).reshape(-1, 3)


def _integers(values: list[int]) -> Ints:
    return np.array(values, np.int64)
