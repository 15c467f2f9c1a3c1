"""A device is asked again only when what it said is in the spool: a kill of the bridge costs one answer at most."""

import asyncio
import sys
from pathlib import Path

from tracemesh.wire.arrays import ArrayCurve, ArrayReading, SensorArray
from tracemesh.wire.device import Device, Hello
from tracemesh_bridge.bridge import Bridge
from tracemesh_bridge.console import Console
from tracemesh_bridge.health import Host
from tracemesh_bridge.source import Link
from tracemesh_bridge.spool import Spool
from tracemesh_bridge.uplink import Uplink

RIBBON = SensorArray(curves=[ArrayCurve(sensors=[0, 1], spacing=[0.1])])
DEVICE = Device(id="d", kind="array", array=RIBBON)
FLAT = (1.0, 0.0, 0.0, 0.0)
READINGS = 200


class Instant:
    """A device that answers at once, and looks each time it is asked how many of its answers were written."""

    device = DEVICE

    def __init__(self, spool):
        self._spool = spool
        self.written = []

    def readings(self, stop):
        for _ in range(READINGS):
            self.written.append(self._spool.written)
            yield ArrayReading(seq=0, time=0.0, quaternion=[FLAT, FLAT])


def test_the_device_never_runs_ahead_of_the_spool(tmp_path, server, monkeypatch):
    spool = Spool(tmp_path, Hello(recording="r", device=DEVICE))
    source, console = Instant(spool), Console()

    async def record():
        uplink = Uplink(server.address, "", spool, Link("server", console.say))
        return await Bridge(source, spool, uplink, Host(Link("device", console.say)), console).run()

    with Path("/dev/null").open() as nobody:
        monkeypatch.setattr(sys, "stdin", nobody)
        assert asyncio.run(record())
    assert source.written == list(range(READINGS))
    assert [message.seq for message in server.messages] == list(range(READINGS))
