"""What a reconstruction tells about itself, in words and JSON-able numbers."""

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.closing import Closing
from tracemesh.geometry.curves.samples import Layout
from tracemesh.geometry.scan import curve_name

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


def fit_warnings(layout: Layout, gaps: Floats, expected: Floats, indices: Ints) -> list[str]:
    """The worst of the segments whose gaps (s, 3), m, random errors (s,), m, do not explain.

    Most likely a node has a wrong number, or a mark was set far from it.
    """
    gap = np.linalg.norm(gaps, axis=1)
    bad = np.flatnonzero((gap > _BAD_FIT * expected) & (gap > _WORTH_A_WARNING * layout.segment_lengths))
    worst = bad[np.argsort(-gap[bad] / expected[bad])][:_MOST]
    return [
        f"{curve_name(indices[layout.segment_curve[s]])} misses its node by {gap[s]:.2g} m on a segment of "
        f"{layout.segment_lengths[s]:.2g} m, more than noise explains: "
        "is a node number wrong, or is it smoothed too much?"
        for s in worst
    ]
