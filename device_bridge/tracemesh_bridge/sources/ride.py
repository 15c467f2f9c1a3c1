"""The ride of a virtual Morphorider: where it is, and what it answers."""

import random
import time

import numpy as np

from tracemesh.geometry.simulated.calibration_ride import CalibrationPlan
from tracemesh.geometry.simulated.simulation import COUNTS, Imperfections, ScanPlan
from tracemesh_bridge.distortion import Distortion, read_file
from tracemesh_bridge.framing import Frame, FrameLayout, encode
from tracemesh_bridge.sources.operator import Operator, operator_keys, ride_plan
from tracemesh_bridge.sources.virtual import LATE_BY, VirtualSettings


class Ride:
    """Where the device is, what it answers, and which keys are due."""

    def __init__(self, settings: VirtualSettings) -> None:
        """The ride begins with the first request. Raises BridgeError if there is no such shape."""
        self._plan, keys = _plan(settings)
        self._wrong = Distortion(read_file(settings.distortion)) if settings.distortion else None
        self._settings = settings
        self._generator = np.random.default_rng(settings.seed)
        self._chance = random.Random(settings.seed)
        self._layout = FrameLayout()
        self._operator = Operator(keys)
        self._began: float | None = None
        self.requests = 0

    @property
    def duration(self) -> float:
        """s that the ride takes."""
        return self._plan.duration / self._settings.speed

    @property
    def time(self) -> float:
        """s since the ride began with the first request."""
        if self._settings.pace == "request":
            return self.requests * self._settings.speed / self._plan.handling.rate
        return 0.0 if self._began is None else (time.monotonic() - self._began) * self._settings.speed

    @property
    def over(self) -> bool:
        """Every key was pressed."""
        return self._operator.over

    @property
    def patience(self) -> float:
        """s until the next key is due, or a while if only requests move the ride on."""
        if self._settings.pace == "request" or self._began is None:
            return 1.0
        return max(0.0, (self._operator.next_time - self.time) / self._settings.speed)

    def press_keys(self) -> None:
        """Print the keys that are due."""
        self._operator.type_until(self.time)

    def answer(self) -> bytes:
        """What the device says to one request: a frame, or a fault."""
        self._began = time.monotonic() if self._began is None else self._began
        self.requests += 1
        raw = self._plan.readings(np.array([self.time]), self._generator)
        turns, small = (int(t) for t in raw.ticks[0])
        acceleration, magnetic = (_vector(v[0]) for v in (raw.acceleration, raw.magnetic))
        frame = Frame((turns, small), acceleration, magnetic)
        return self._spoil(encode(self._layout, self._wrong(frame) if self._wrong else frame))

    def _spoil(self, frame: bytes) -> bytes:
        fault = self._next_fault()
        noise = self._chance.randbytes(len(frame))
        said = {
            "short": frame[: len(frame) // 2],
            "garbage": noise,
            "silent": b"",
            "surplus": frame + noise[:5],
            "duplicate": frame + frame,
        }.get(fault, frame)
        if fault == "late":
            time.sleep(LATE_BY)
        if self._settings.log and said.startswith(frame):
            with self._settings.log.open("a") as log:
                log.write(f"{frame.hex()}\n")
        return said

    def _next_fault(self) -> str:
        dice = self._chance.random()
        for name, probability in self._settings.faults:
            if dice < probability:
                return name
            dice -= probability
        return ""


def _plan(settings: VirtualSettings) -> tuple[ScanPlan | CalibrationPlan, list[tuple[float, str]]]:
    """How the device is moved, and the keys of its operator."""
    if settings.calibrating:
        calibrated = CalibrationPlan(Imperfections().scaled(settings.noise))
        return calibrated, [(time, "") for time in calibrated.enters]
    plan = ride_plan(settings.shape, settings.noise, settings.seed)
    return plan, list(operator_keys(plan))


def _vector(counts: np.ndarray[tuple[int], np.dtype[np.int64]]) -> tuple[float, float, float]:
    x, y, z = (float(c) / (COUNTS + 1) for c in counts)
    return (x, y, z)
