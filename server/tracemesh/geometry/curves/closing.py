"""Whether the curves of a network have errors as a whole, and which: variances first, then the adjustment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tracemesh.geometry.curves.adjustment import Adjustment, Corrections
from tracemesh.geometry.curves.bias import Variances, estimate_variances, with_noise_of
from tracemesh.geometry.curves.correction import correct_curves
from tracemesh.geometry.curves.misclosure import Misclosures, NoiseLevel
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
_UNEXPLAINED = 4.0  # times the expected variance; frames' noise that explains the gaps is found to be under 2
_FIRST_SHIFT = 0.05  # steps: a first guess at the deviation of node marks


@dataclass(frozen=True)
class Closing:
    """How a network closes. gain: logarithm of how much likelier errors of whole curves make it, penalised.

    noise: expected in the equations; the variances say how much larger it is.
    """

    variances: Variances
    adjustment: Adjustment
    corrections: Corrections
    gain: float
    noise: NoiseLevel

    @property
    def walk(self) -> Floats:
        """Covariance (s, 3, 3), m, per metre of positions along each segment, as the equations show it."""
        return self.noise.walk * self.variances.segments

    @property
    def is_explained(self) -> bool:
        """Whether the frames' noise and errors of whole curves explain what keeps the network from closing."""
        return self.variances.with_bias and self.variances.segments < _UNEXPLAINED

    def covariance(self, layout: Layout) -> Floats | None:
        """Covariance (s, 3, 3), m^2, of segment vectors, by which positions share out the gaps.

        None where that noise does not explain the gaps: then every metre errs alike, whatever noise was found.
        """
        return self.noise.of_segments(layout.segment_lengths) if self.is_explained else None

    def expected_gaps(self, layout: Layout) -> Floats:
        """Root mean square (s,), m, of segments' gaps from the random errors alone that cross-validation found."""
        covariance = self.noise.of_segments(layout.segment_lengths)
        return np.asarray(np.sqrt(np.trace(covariance, axis1=1, axis2=2)))

    def noise_factor(self, layout: Layout, gaps: Floats) -> float:
        """Ratio of the noise that gaps (s, 3), m, of final positions show to the expected one, if clearly above 1."""
        loops = len(gaps) - layout.node_count + 1
        if not loops:
            return 1.0
        expected = self.expected_gaps(layout) ** 2 * self.variances.segments
        ratio = float(np.sqrt(np.sum(np.sum(gaps**2, axis=1) / expected) / loops))
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
    """Errors of whole curves from the smoothed frames of `choice`, if `mode` or the data ask for them.

    That frames err more about one axis than about another, as those of compass and gravity do, counts only where their
    noise explains what is left of the gaps: an error that is not modelled has its own directions.
    """
    noise = noise_level(curves, choice, step, layout)
    found = _estimated(Misclosures(layout, choice.frames, noise), step, mode)
    if found.is_explained:
        return found
    return _estimated(Misclosures(layout, choice.frames, noise.alike()), step, mode)


def _estimated(misclosures: Misclosures, step: float, mode: Mode) -> Closing:
    without, with_bias = estimate_variances(misclosures, _FIRST_SHIFT * step)
    gain = with_bias.evidence - without.evidence
    variances = with_bias if mode == "on" or (mode == "auto" and gain > 0 and with_bias.plausible) else without
    adjustment = Adjustment(misclosures, variances)
    return Closing(variances, adjustment, adjustment.solution(), gain, misclosures.noise)


def _next(found: Closing, curves: Sequence[PlacedCurve], layout: Layout, choice: Choice, step: float) -> Closing:
    """What is left of the errors found so far; the noise is estimated again, without what large rotations added."""
    noise = noise_level(curves, choice, step, layout)
    misclosures = Misclosures(layout, choice.frames, noise if found.is_explained else noise.alike())
    variances = with_noise_of(misclosures, found.variances)
    adjustment = Adjustment(misclosures, variances, found.corrections)
    return Closing(variances, adjustment, adjustment.solution(), found.gain, misclosures.noise)


def close_network(
    curves: Sequence[PlacedCurve],
    samples: NetworkSamples,
    choice: Choice,
    step: float,
    prefilter: float,
    mode: Mode,
) -> Closed:
    """Find errors of whole curves and take them back; large rotations, for which the equations are rough, in rounds.

    step, prefilter: those of the samples, m.
    """
    found = closing = _first(curves, samples.layout, choice, step, mode)
    start = choice.frames
    for left in reversed(range(_ROUNDS if closing.variances.with_bias else 0)):
        curves = correct_curves(curves, closing.corrections)
        start = exp(closing.corrections.rotation)[samples.layout.curve] @ choice.frames
        samples = resample(curves, moved_layout(samples.layout, curves), step, prefilter)
        if not left or np.abs(closing.corrections.rotation).max() < _SMALL:
            break
        choice = replace(choice, frames=smooth_frames(curves, samples, choice.weights))
        closing = _next(found, curves, samples.layout, choice, step)
        found = replace(found, corrections=found.corrections.followed_by(closing.corrections))
    return Closed(samples, start, closing, found)
