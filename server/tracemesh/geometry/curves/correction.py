"""Measured curves with their errors as a whole taken back: turned frames, stretched lengths, shifted marks."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.adjustment import Corrections
from tracemesh.geometry.curves.placement import PlacedCurve
from tracemesh.geometry.rotations import exp, matrix_to_quaternion, quaternion_product

Floats = NDArray[np.float64]

_CLOSEST = 0.5  # of the distance between two marks that corrections must leave


def _allowed(marks: Floats, shift: Floats) -> Floats:
    """Shifts (m,) of marks (m,), m, reduced where they would bring two marks too near each other."""
    nearer = np.max(-np.diff(shift) / np.diff(marks), initial=0.0)
    return shift * min(1.0, (1 - _CLOSEST) / nearer) if nearer > 0 else shift


def _corrected(curve: PlacedCurve, rotation: Floats, scale: float, shift: Floats) -> PlacedCurve:
    shift, scale = _allowed(curve.marks, shift), max(scale, -_CLOSEST)
    marks = (1 + scale) * (curve.marks + shift - shift[0])
    arc = (1 + scale) * (curve.arc - shift[0])
    turn = exp(rotation)
    quaternion, tangent = quaternion_product(matrix_to_quaternion(turn), curve.quaternion), curve.tangent @ turn.T
    if curve.closed:
        inside = (arc >= 0) & (arc <= marks[-1])
        arc, quaternion, tangent = arc[inside], quaternion[inside], tangent[inside]
    return replace(curve, arc=arc, quaternion=quaternion, tangent=tangent, marks=marks)


def correct_curves(curves: Sequence[PlacedCurve], corrections: Corrections) -> tuple[PlacedCurve, ...]:
    """The curves with the corrections of an adjustment of theirs applied."""
    counts = np.cumsum([len(c.marks) for c in curves])[:-1]
    shifts = np.split(corrections.shift, counts)
    parts = zip(curves, corrections.rotation, corrections.scale, shifts, strict=True)
    return tuple(_corrected(curve, rotation, float(scale), shift) for curve, rotation, scale, shift in parts)
