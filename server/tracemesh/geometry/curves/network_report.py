"""What a reconstruction tells about itself, in words and JSON-able numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.closing import Closing
from tracemesh.geometry.curves.samples import Layout

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_BAD_FIT = 8.0  # times the expected gap
_WORTH_A_WARNING = 0.02  # of a segment's length
_MOST = 3  # warnings; one wrong node number spoils its neighbours too


def bias_report(closing: Closing | None, indices: Ints) -> dict[str, object]:
    """Errors of whole curves as found; indices: (c,) of the curves in the scan.

    evidence: logarithm of how much likelier they make the network.
    """
    if closing is None or not closing.variances.with_bias:
        return {"on": False, "evidence": closing.gain if closing else None}
    variances, corrections = closing.variances, closing.corrections
    axes = np.sqrt(np.maximum(np.linalg.eigvalsh(variances.rotation), 0.0))
    curves = [
        {"curve": int(index) + 1, "rotation_deg": np.rad2deg(rotation).tolist(), "scale": float(scale)}
        for index, rotation, scale in zip(indices, corrections.rotation, corrections.scale, strict=True)
    ]
    return {
        "on": True,
        "evidence": closing.gain,
        "rotation_deviation_deg": np.rad2deg(axes).tolist(),
        "scale_deviation": float(np.sqrt(variances.scale)),
        "mark_deviation_m": float(np.sqrt(variances.shift)),
        "curves": curves,
    }


@dataclass(frozen=True)
class Misfit:
    """A segment, by its place in the network, of the curve at an index of the scan, that misses its node.

    gap, length: m, of the segment.
    """

    segment: int
    curve: int
    gap: float
    length: float

    def warning(self, curve: str) -> str:
        """In words, where the curve has this name."""
        return (
            f"{curve} misses its node by {self.gap:.2g} m on a segment of {self.length:.2g} m, more than noise "
            "explains: is a node number wrong, or is it smoothed too much?"
        )


def find_misfits(layout: Layout, gaps: Floats, expected: Floats, indices: Ints) -> tuple[Misfit, ...]:
    """The worst of the segments whose gaps (s, 3), m, random errors (s,), m, do not explain.

    Most likely a node has a wrong number, or a mark was set far from it.
    """
    gap = np.linalg.norm(gaps, axis=1)
    bad = np.flatnonzero((gap > _BAD_FIT * expected) & (gap > _WORTH_A_WARNING * layout.segment_lengths))
    worst = bad[np.argsort(-gap[bad] / expected[bad])][:_MOST]
    curves = indices[layout.segment_curve]
    return tuple(Misfit(int(s), int(curves[s]), float(gap[s]), float(layout.segment_lengths[s])) for s in worst)
