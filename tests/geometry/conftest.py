"""Scans of built-in shapes with known noise, and the exact points that a network of them should have."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.rotations import exp
from tracemesh.geometry.scan import CurveScan, Scan
from tracemesh.geometry.simulated.shape_curves import ShapeCurve
from tracemesh.geometry.simulated.shapes import SHAPES

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Faults:
    """noise: rad per axis of every frame; heading: rad about the vertical, per curve; scale: relative, per curve;
    mark: m, how far from a node it is marked.
    """

    noise: float = 0.0
    heading: float = 0.0
    scale: float = 0.0
    mark: float = 0.0


@dataclass(frozen=True)
class FaultyScan:
    """A scan, and the errors that its curves have as a whole: heading (c,) rad, scale (c,)."""

    scan: Scan
    curves: tuple[ShapeCurve, ...]
    heading: Floats
    scale: Floats


def _scan_curve(
    curve: ShapeCurve, spacing: float, faults: Faults, heading: float, scale: float, random: np.random.Generator
) -> CurveScan:
    ends = np.array(curve.node_positions)
    marks = ends + faults.mark * random.standard_normal(len(ends))
    between = np.arange(marks[0], marks[-1], spacing) + spacing * random.uniform(0.0, 0.3)
    arc = np.union1d(np.concatenate([between, marks]), [])
    arc = arc[(arc >= marks[0]) & (arc <= marks[-1])]
    turn = exp(np.array([0.0, 0.0, heading]))
    frames = turn @ curve.at(arc)[1] @ exp(faults.noise * random.standard_normal((len(arc), 3)))
    samples = np.searchsorted(arc, marks)
    return CurveScan(
        (1 + scale) * arc, frames[:, :, 0], frames[:, :, 1], samples, curve.node_ids, curve.boundary, curve.closed
    )


@pytest.fixture(scope="session")
def faulty_scan() -> Callable[..., FaultyScan]:
    """Function (shape name, spacing in m, seed, sizes of the faults) -> FaultyScan."""

    def make(name: str, spacing: float = 0.0013, seed: int = 0, **sizes: float) -> FaultyScan:
        faults, random = Faults(**sizes), np.random.default_rng(seed)
        curves = SHAPES[name]().curves
        heading = faults.heading * random.standard_normal(len(curves))
        scale = faults.scale * random.standard_normal(len(curves))
        scans = [
            _scan_curve(curve, spacing, faults, b, s, random)
            for curve, b, s in zip(curves, heading, scale, strict=True)
        ]
        return FaultyScan(Scan(tuple(scans)), curves, heading, scale)

    return make


@pytest.fixture(scope="session")
def true_points() -> Callable[[CurveNetwork, Sequence[ShapeCurve]], Floats]:
    """Function (network, curves) -> exact positions (n, 3) of points at the same share of their segment."""

    def find(network: CurveNetwork, curves: Sequence[ShapeCurve]) -> Floats:
        points = np.full_like(network.points, np.nan)
        passed = dict.fromkeys(range(len(curves)), 0)
        for segment in network.segments:
            ends = curves[segment.curve].node_positions[passed[segment.curve] :][:2]
            passed[segment.curve] += 1
            points[segment.points] = curves[segment.curve].at(np.linspace(*ends, len(segment.points)))[0]
        return points

    return find


@pytest.fixture(scope="session")
def misfit() -> Callable[[Floats, Floats], Floats]:
    """Function (points, truth) -> distances (n,), m, of points from their own truth, best placed rigidly."""

    def measure(points: Floats, truth: Floats) -> Floats:
        x, y = points - points.mean(axis=0), truth - truth.mean(axis=0)
        u, _, vt = np.linalg.svd(x.T @ y)
        flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
        return np.linalg.norm(x @ (u @ flip @ vt) - y, axis=1)

    return measure
