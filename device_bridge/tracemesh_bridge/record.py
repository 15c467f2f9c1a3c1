"""What every recording command does once its source is known."""

import asyncio
import os
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tracemesh.wire.device import Device, Hello
from tracemesh_bridge.bridge import Bridge, upload
from tracemesh_bridge.console import Console
from tracemesh_bridge.health import Host
from tracemesh_bridge.recorder import Recorder
from tracemesh_bridge.source import Link, Source
from tracemesh_bridge.spool import Spool, exclusive, open_spools
from tracemesh_bridge.uplink import Uplink

TOKEN_VARIABLE = "TRACEMESH_TOKEN"


@dataclass(frozen=True)
class Target:
    """Where a recording goes. server: address; session: to record into, or None for a new one; spool: folder."""

    server: str
    session: str | None
    spool: Path


def record(target: Target, device: Device, make_source: Callable[[Host], Source]) -> bool:
    """Record a device until the operator quits; whether the server has everything then.

    Raises BridgeError if the spool cannot be used or the source cannot go on.
    """
    name = f"{device.kind}-{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(3)}"
    hello = Hello(recording=name, session=target.session, device=device)
    with exclusive(target.spool):
        spool, left_over = open_spools(target.spool, hello)
        return asyncio.run(_record(target.server, spool, left_over, make_source))


async def _record(server: str, spool: Spool, left_over: list[Spool], make_source: Callable[[Host], Source]) -> bool:
    console = Console()

    def uplink(spool: Spool, name: str) -> Uplink:
        return Uplink(server, os.environ.get(TOKEN_VARIABLE, ""), spool, Link(name, console.say))

    host = Host(Link("device", console.say))
    for old in left_over:
        Recorder(old)  # takes in the samples that were in no message yet when the bridge was killed
        old.sync()
    bridge = Bridge(make_source(host), spool, uplink(spool, "server"), host, console)
    uploads = [asyncio.ensure_future(upload(s, uplink(s, f"left-over {s.place.name}"))) for s in left_over]
    try:
        return await bridge.run()
    finally:
        for task in uploads:
            task.cancel()
        await asyncio.gather(*uploads, return_exceptions=True)
