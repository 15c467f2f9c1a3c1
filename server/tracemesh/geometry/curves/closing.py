"""Whether the curves of a network have errors as a whole, and which: variances first, then the adjustment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.adjustment import Adjustment, Corrections
from tracemesh.geometry.curves.bias import Variances, estimate_variances, with_noise_of
from tracemesh.geometry.curves.correction import correct_curves
from tracemesh.geometry.curves.misclosure import Misclosures
from tracemesh.geometry.curves.placement import PlacedCurve, moved_layout
from tracemesh.geometry.curves.resampling import resample
from tracemesh.geometry.curves.samples import Layout, NetworkSamples
from tracemesh.geometry.curves.weights import Choice, noise_level, smooth_frames
from tracemesh.geometry.rotations import exp

Floats = NDArray[np.float64]
Mode = Literal["auto", "on", "off"]

_ROUNDS = 4
_SMALL = 0.05  # rad; the equations err by half the square of what they are about

_CLEARLY = 1.5  # more than chance makes of a few loops
_FIRST_SHIFT = 0.05  # steps: a first guess at the deviation of node marks


@dataclass(frozen=True)
class Closing:
    """How a network closes. gain: logarithm of how much likelier errors of whole curves make it, penalised.

    walk: (c,) m, variance per metre and axis of each curve's positions. drift: relative to a segment's length.
    """

    variances: Variances
    adjustment: Adjustment
    corrections: Corrections
    gain: float
    walk: Floats
    drift: float

    def expected_gaps(self, layout: Layout) -> Floats:
        """Root mean square (s,), m, of segments' gaps from the random errors alone that cross-validation found."""
        length = layout.segment_lengths
        walk = self.walk[layout.segment_curve] / self.variances.segments
        result: Floats = np.sqrt(3 * (walk * length + (self.drift * length) ** 2))
        return result

    def noise_factor(self, layout: Layout, gaps: Floats) -> float:
        """Ratio of the noise that gaps (s, 3), m, of final positions show to the expected one, if clearly above 1."""
        loops = len(gaps) - layout.node_count + 1
        if not loops:
            return 1.0
        length = layout.segment_lengths
        expected = self.walk[layout.segment_curve] * length + self.variances.segments * (self.drift * length) ** 2
        ratio = float(np.sqrt(np.sum(np.sum(gaps**2, axis=1) / expected) / (3 * loops)))
        return ratio if ratio > _CLEARLY else 1.0


@dataclass(frozen=True)
class Closed:
    """Samples of curves freed from their errors as a whole, and a smooth start (n, 3, 3) for their regression.

    closing: of these samples. found: the errors taken back, all rounds together, with the variances of the first.
    """

    samples: NetworkSamples
    start: Floats
    closing: Closing
    found: Closing


def _first(curves: Sequence[PlacedCurve], layout: Layout, choice: Choice, step: float, mode: Mode) -> Closing:
    """Errors of whole curves from the smoothed frames of `choice`, if `mode` or the data ask for them."""
    noise = noise_level(curves, choice, step)
    misclosures = Misclosures(layout, choice.frames, noise)
    without, with_bias = estimate_variances(misclosures, _FIRST_SHIFT * step)
    gain = with_bias.evidence - without.evidence
    variances = with_bias if mode == "on" or (mode == "auto" and gain > 0 and with_bias.plausible) else without
    adjustment = Adjustment(misclosures, variances)
    return Closing(variances, adjustment, adjustment.solution(), gain, noise.walk * variances.segments, noise.drift)


def _next(found: Closing, curves: Sequence[PlacedCurve], layout: Layout, choice: Choice, step: float) -> Closing:
    """What is left of the errors found so far; the noise is estimated again, without what large rotations added."""
    noise = noise_level(curves, choice, step)
    misclosures = Misclosures(layout, choice.frames, noise)
    variances = with_noise_of(misclosures, found.variances)
    adjustment = Adjustment(misclosures, variances, found.corrections)
    return Closing(
        variances, adjustment, adjustment.solution(), found.gain, noise.walk * variances.segments, noise.drift
    )


def close_network(
    curves: Sequence[PlacedCurve], samples: NetworkSamples, choice: Choice, step: float, mode: Mode
) -> Closed:
    """Find errors of whole curves and take them back; large rotations, for which the equations are rough, in rounds."""
    found = closing = _first(curves, samples.layout, choice, step, mode)
    start = choice.frames
    for left in reversed(range(_ROUNDS if closing.variances.with_bias else 0)):
        curves = correct_curves(curves, closing.corrections)
        start = exp(closing.corrections.rotation)[samples.layout.curve] @ choice.frames
        samples = resample(curves, moved_layout(samples.layout, curves), step)
        if not left or np.abs(closing.corrections.rotation).max() < _SMALL:
            break
        choice = replace(choice, frames=smooth_frames(curves, samples, choice.weights))
        closing = _next(found, curves, samples.layout, choice, step)
        found = replace(found, corrections=found.corrections.followed_by(closing.corrections))
    return Closed(samples, start, closing, found)
