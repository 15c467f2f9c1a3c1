"""What the server has of a recording, ahead of the database by the messages that wait to be committed."""

from dataclasses import dataclass, field

from tracemesh.errors import Refused
from tracemesh.wire.arrays import ArrayReading, misfit
from tracemesh.wire.device import CurveEnd, CurveStart, Hello, NodeMark, OfCurve, Recorded, Samples, Wheel

TURNS_RANGE = 2**16
"""A wheel's turns are counted with 16 bits."""


@dataclass
class CurveState:
    """One curve: number within the session, samples so far, length and odometer in m."""

    index: int
    samples: int = 0
    length: float = 0.0
    odometer: float | None = None
    ended: bool = False


@dataclass
class SessionState:
    """What recordings of one session share: how its next curve and the next reading of an array are numbered."""

    id: str
    next_index: int
    next_reading: int
    bytes: int

    def catch_up(self, stored: "SessionState") -> None:
        """Other servers may have added to what is stored."""
        self.next_index = max(self.next_index, stored.next_index)
        self.next_reading = max(self.next_reading, stored.next_reading)
        self.bytes = max(self.bytes, stored.bytes)


@dataclass(eq=False)
class RecordingState:
    """A recording as accepted so far; `committed` messages of it are durable.

    `taken_over`: another server, or this one before it was started again, had it last.
    """

    key: int
    session: SessionState
    hello: Hello
    next_seq: int
    committed: int
    bytes: int
    curves: dict[int, CurveState] = field(default_factory=dict)
    taken_over: bool = False

    def check(self, message: Recorded) -> None:
        """Raise Refused when the message does not fit what came before it."""
        if message.seq > self.next_seq:
            raise Refused("gap", f"wanted message {self.next_seq}, got {message.seq}", self.next_seq)
        if isinstance(message, ArrayReading):
            if why := misfit(self.hello.device.array, message):
                raise Refused("malformed", f"message {message.seq}: {why}")
        elif self.hello.device.array is not None:
            raise Refused("malformed", f"message {message.seq}: wanted a reading from an array, got {message.type}")
        else:
            self._check_order(message)

    def _check_order(self, message: OfCurve) -> None:
        curve = self.curves.get(message.curve)
        if isinstance(message, CurveStart):
            if curve is not None:
                raise Refused("malformed", f"message {message.seq}: curve {message.curve} was started before")
        elif curve is None or (curve.ended and not isinstance(message, NodeMark)):
            state = "never started" if curve is None else "ended before"
            raise Refused("malformed", f"message {message.seq}: {message.type} of curve {message.curve}, which {state}")
        elif isinstance(message, Samples):
            self._check_samples(message, curve)

    def _check_samples(self, message: Samples, curve: CurveState) -> None:
        if message.first_sample != curve.samples:
            raise Refused(
                "malformed",
                f"message {message.seq}: curve {message.curve} has {curve.samples} samples, "
                f"wanted first_sample {curve.samples}, got {message.first_sample}",
            )
        if message.ticks is not None and self.hello.device.wheel is None:
            raise Refused("malformed", f"message {message.seq}: ticks from a device whose hello has no wheel")

    def advance(self, message: Recorded, size: int) -> None:
        """Take a message of `size` bytes that `check` let through."""
        self.next_seq += 1
        self.bytes += size
        self.session.bytes += size
        if isinstance(message, ArrayReading):
            self.session.next_reading += 1
        elif isinstance(message, CurveStart):
            self.curves[message.curve] = CurveState(self.session.next_index)
            self.session.next_index += 1
        elif isinstance(message, Samples):
            self.curves[message.curve].samples += message.count
            self._travel(self.curves[message.curve], message)
        elif isinstance(message, CurveEnd):
            self.curves[message.curve].ended = True

    def _travel(self, curve: CurveState, message: Samples) -> None:
        first, last = _odometer(message, self.hello)
        if first is None or last is None:
            return
        step = last - (first if curve.odometer is None else curve.odometer)
        if message.ticks is not None and self.hello.device.wheel is not None:
            range_ = TURNS_RANGE * self.hello.device.wheel.circumference
            step = (step + range_ / 2) % range_ - range_ / 2
        curve.length += abs(step)
        curve.odometer = last


def _odometer(message: Samples, hello: Hello) -> tuple[float | None, float | None]:
    """Distance (m) of the first and the last sample of a block, where the device measures any."""
    wheel = hello.device.wheel
    if message.ticks is not None and wheel is not None:
        first, last = message.ticks[0], message.ticks[-1]
        return _turned(wheel, *first), _turned(wheel, *last)
    if message.distance is not None:
        return message.distance[0], message.distance[-1]
    return None, None


def _turned(wheel: Wheel, big: int, small: int) -> float:
    return (big + small / wheel.ticks_per_turn) * wheel.circumference
