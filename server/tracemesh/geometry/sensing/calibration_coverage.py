"""How much of the sphere of directions a sensor has seen while its device was turned."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from tracemesh.geometry.rotations import normalized
from tracemesh.geometry.scan import Floats

_STEPS = [step for step in product((-1, 0, 1), repeat=3) if any(step)]
DIRECTIONS: Floats = normalized(np.array(_STEPS, float))
"""(26, 3): the faces, edges and corners of a cube, as seen from its middle."""
NAMES = tuple("".join(" +-"[s] + axis for s, axis in zip(step, "xyz", strict=True) if s) for step in _STEPS)
"""What people call them: +x, -y+z, ... in the device's axes."""


@dataclass(frozen=True)
class Coverage:
    """fraction: of DIRECTIONS that something was measured near to; missing: names of the others, faces first."""

    fraction: float
    missing: tuple[str, ...]

    def in_words(self, most: int = 6) -> str:
        """The missing directions, as many as a person wants to read at once."""
        rest = len(self.missing) - most
        return ", ".join(self.missing[:most]) + (f" and {rest} more" if rest > 0 else "")


def coverage(vectors: Floats) -> Coverage:
    """Which directions vectors (n, 3) have; ones without length or of no finite one count for nothing."""
    size = np.abs(vectors).max(axis=1, initial=0.0)
    good = vectors[(size > 1e-150) & (size < 1e150)]
    nearest = (normalized(good) @ DIRECTIONS.T).argmax(axis=1)
    seen = np.zeros(len(DIRECTIONS), bool)
    seen[nearest] = True
    missing = sorted((NAMES[i] for i in np.flatnonzero(~seen)), key=lambda name: (len(name), name))
    return Coverage(float(seen.mean()), tuple(missing))
