"""The ride that virtual devices share: the plan of a scan, and the operator who presses keys while it goes on.

Apart from the devices because the simulation brings half of scipy with it, which no other command needs.
"""

import os
import sys
from collections import deque
from collections.abc import Iterable, Iterator

from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.geometry.simulated.simulation import Handling, Imperfections, ScanPlan, plan_scan
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.sources.virtual import say


def ride_plan(shape: str, noise: float, seed: int) -> ScanPlan:
    """The scan of a built-in shape with so much of the usual imperfections. Raises BridgeError if it is not one."""
    if shape not in SHAPES:
        raise BridgeError(f"wanted one of the shapes {', '.join(sorted(SHAPES))}, got {shape!r}")
    return plan_scan(SHAPES[shape](), Handling(), Imperfections().scaled(noise), seed)


class Operator:
    """Types on stdout what is due, when it is due."""

    def __init__(self, keys: Iterable[tuple[float, str]]) -> None:
        """`keys`: what to type, a line each, and when (s since the ride began), in order."""
        self._keys = deque(keys)
        self._is_heard = True

    @property
    def over(self) -> bool:
        """Everything was typed."""
        return not self._keys

    @property
    def next_time(self) -> float:
        """When the next key is due, s since the ride began; not once it is over."""
        return self._keys[0][0]

    def type_until(self, time: float) -> None:
        """Type what is due."""
        while self._keys and self._keys[0][0] <= time:
            _, keys = self._keys.popleft()
            try:
                if self._is_heard:
                    os.write(sys.stdout.fileno(), f"{keys}\n".encode())
            except BrokenPipeError:
                self._is_heard = False
                say("nobody reads the operator's keys any more")


def operator_keys(plan: ScanPlan) -> Iterator[tuple[float, str]]:
    """What the operator types, and when (s since the ride began)."""
    curves = iter(plan.curves)
    for press in plan.keys:
        match press.key:
            case "boundary":
                yield press.time, "-"
            case "interior":
                yield press.time, "+"
            case "node":
                yield press.time, str(press.node)
            case "end":
                yield press.time, "*" if next(curves).closed else "."
    yield plan.duration + 0.5, "q"
