"""Health of a device, as the live view tells it."""

from tracemesh.api.live.meter import Meter
from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import Device, Hello


def test_every_reading_of_the_last_second_counts() -> None:
    """However many there are: an array, or a bridge that catches up, sends thousands of messages a second."""
    meter = Meter(Hello(recording="r", device=Device(id="d", kind="test")))
    reading = ArrayReading(seq=0, time=0.0, quaternion=[(1.0, 0.0, 0.0, 0.0)])
    for _ in range(20_000):
        meter.add(reading)
    assert meter.read().rate >= 20_000
