"""A Morphorider that is calibrated, simulated in time: turned about, laid on its faces, rolled along a line.

The same interface as `simulation.ScanPlan`, so that whatever plays a scan plays this, too.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from tracemesh.geometry.scan import Floats
from tracemesh.geometry.simulated.simulation import (
    REFERENCE_ACCELERATION,
    REFERENCE_MAGNETIC,
    Handling,
    Imperfections,
    Readings,
    raw_readings,
)

TURNING, FACE, RUN = 40.0, 2.5, 5.0
"""s: all directions, one face, the straight run."""
PAUSE = 4.0
"""s before and after each step, in which the operator presses Enter."""
LENGTH = 1.0
"""m, of the straight run."""
_QUARTERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [2, 0, 0]])
_FACES = Rotation.from_rotvec(np.pi / 2 * _QUARTERS)


@dataclass(frozen=True)
class CalibrationPlan:
    """Where the device is at any time; `enters` (4,) s: when the operator says that a step is done."""

    imperfections: Imperfections = field(default_factory=Imperfections)
    handling: Handling = field(default_factory=Handling)
    enters: tuple[float, ...] = field(
        default=(
            TURNING + PAUSE / 2,
            TURNING + PAUSE + 6 * FACE + PAUSE / 2,
            TURNING + 2 * PAUSE + 6 * FACE + PAUSE / 2,
            TURNING + 3 * PAUSE + 6 * FACE + RUN + PAUSE / 2,
        ),
        init=False,
    )

    @property
    def duration(self) -> float:
        """Until the last key, s."""
        return self.enters[-1]

    def readings(self, time: Floats, generator: np.random.Generator) -> Readings:
        """What the device answers at times (n,) s; after the end it stays where it is."""
        frames = self._pose(time).as_matrix()
        vectors = np.stack([np.array(e) @ frames for e in (REFERENCE_ACCELERATION, REFERENCE_MAGNETIC)])
        return raw_readings(self._travelled(time), vectors, self.imperfections, generator)

    def _pose(self, time: Floats) -> Rotation:
        """Up goes round on a spiral from the device's north pole to its south pole, while the device turns about it."""
        part = np.clip(time / TURNING, 0.0, 1.0)
        spiral = Rotation.from_euler("zx", np.column_stack([20 * np.pi * part, np.pi * part]))
        turning = Rotation.from_rotvec(np.outer(14 * np.pi * part, [0.0, 0.0, 1.0])) * spiral
        face = np.clip((time - TURNING - PAUSE) / FACE, 0.0, 6.0 - 1e-9)
        lying = _FACES[face.astype(int)]
        later = time >= TURNING + PAUSE
        return Rotation.from_quat(np.where(later[:, None], lying.as_quat(), turning.as_quat()))

    def _travelled(self, time: Floats) -> Floats:
        begin = TURNING + 3 * PAUSE + 6 * FACE
        part = np.clip((time - begin) / RUN, 0.0, 1.0)
        result: Floats = LENGTH * part * part * (3 - 2 * part)
        return result
