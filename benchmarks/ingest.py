"""Devices on one server: how long an acknowledgement, which comes after the durable commit, and the live view take."""

import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
import uvloop
from websockets.asyncio.client import connect as connect_to

from benchmarks.data import Data
from benchmarks.load import BATCH, PERIOD, RATE, Device, Load, connect, send
from benchmarks.serving import free_port, memory, processor_time, wait_for_server
from benchmarks.table import Cell, Column, Table

BEARABLE = 100.0
"""ms; acknowledgements of a load that is not too much take no longer, but for one in a hundred."""
SEARCH_SECONDS = 15.0
"""s of each run that only looks for the limit."""
SETTLE = 3.0
"""s that the server's workers get to start, before anything is measured."""

COLUMNS = (
    Column("devices", "d"),
    Column("s", ".0f"),
    Column("messages/s", ".0f"),
    *(Column(f"ack {name}, ms", ".1f") for name in ("p50", "p95", "p99", "max")),
    *(Column(f"live view {name}, ms", ".1f") for name in ("p50", "p95")),
    Column("lost", "d"),
    Column("server, s of processor a s", ".2f"),
    *(Column(f"memory {when}, MB", ".0f") for when in ("after a quarter", "at the end")),
)
NOTES = (
    f"""Every device sends {RATE} samples a second (acceleration, magnetic field, ticks, time) in messages of {BATCH} to
    one server process on SQLite, synchronous=FULL; the load generator shares the machine. Ack: from sending a message
    to its acknowledgement. Live view: from sending a message to its points' arrival at somebody who watches, where they
    come 60 times a second. Lost: messages that the server does not have at the end.""",
)


def ingest(data: Data, devices: tuple[int, ...] = (100, 300, 500), seconds: float = 60.0, further: int = 100) -> Table:
    """Table of one row per number of devices, then so many more in each shorter run until it is too much.

    `data` is not needed; `further` = 0 does not look for the limit.
    """
    rows = [_row(count, seconds) for count in devices]
    while further and _bearable(rows[-1]):
        rows.append(_row(int(rows[-1][0] or 0) + further, SEARCH_SECONDS))
    limit = max((int(row[0] or 0) for row in rows if _bearable(row)), default=0)
    found = f"Limit found: {limit} devices, with 99 of 100 acknowledgements within {BEARABLE:.0f} ms and none lost."
    return Table("ingest", "Devices on one server", COLUMNS, tuple(rows), (*NOTES, found))


@dataclass
class Seen:
    """What was measured while the devices sent: waits in s, processor time and elapsed time in s, memory in MB."""

    load: Load = field(default_factory=Load)
    live: list[float] = field(default_factory=list)
    busy: float = 0.0
    elapsed: float = 0.0
    memory: list[float] = field(default_factory=list)


def _bearable(row: tuple[Cell, ...]) -> bool:
    figures = dict(zip((column.title for column in COLUMNS), row, strict=True))
    p99, lost = figures["ack p99, ms"], figures["lost"]
    return isinstance(p99, float) and p99 <= BEARABLE and lost == 0


def _row(devices: int, seconds: float) -> tuple[Cell, ...]:
    messages = round(seconds / PERIOD) + 1
    with tempfile.TemporaryDirectory() as folder:
        port = free_port()
        command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(port), "--data-dir", folder]
        environment = {**os.environ, "TRACEMESH_MAX_DEVICES": "100000"}
        server = subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment)
        try:
            wait_for_server(port)
            seen = uvloop.run(_measure(server.pid, port, devices, messages))
        finally:
            server.terminate()
            server.wait()
    acks = (float(q) for q in 1000 * np.quantile(seen.load.waits, (0.5, 0.95, 0.99, 1.0)))
    live = (float(q) for q in 1000 * np.quantile(seen.live, (0.5, 0.95)))
    lost = devices * messages - seen.load.acknowledged
    rate, busy = len(seen.load.waits) / seen.elapsed, seen.busy / seen.elapsed
    return (devices, seconds, rate, *acks, *live, lost, busy, seen.memory[0], seen.memory[-1])


async def _measure(server: int, port: int, devices: int, messages: int) -> Seen:
    """Connect all, then let them send."""
    seen = Seen()
    connected = await connect(devices, port, seen.load)
    watching = asyncio.create_task(_watch(connected[0], port, seen.live))
    await asyncio.sleep(SETTLE)
    sampling = asyncio.create_task(_sample_memory(server, PERIOD * messages / 4, seen.memory))
    busy, start = processor_time(server), time.perf_counter()
    await send(connected, messages)
    seen.busy, seen.elapsed = processor_time(server) - busy, time.perf_counter() - start
    seen.memory.append(memory(server))
    for task in (watching, sampling):
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
    for device in connected:
        device.close()
    return seen


async def _watch(device: Device, port: int, waits: list[float]) -> None:
    """Watch a device's session: every sample that it sends is one more point."""
    seen = 0
    session = await device.session
    async with connect_to(f"ws://127.0.0.1:{port}/api/v1/sessions/{session}/live", max_size=None) as watching:
        async for text in watching:
            message = json.loads(text)
            if message["type"] == "live.points":
                now = time.perf_counter()
                newest = (message["first"] + len(message["positions"]) // 3) // BATCH
                waits += [now - sent for sent in device.sent[seen + 1 : newest + 1]]
                seen = newest


async def _sample_memory(server: int, interval: float, sampled: list[float]) -> None:
    while True:
        await asyncio.sleep(interval)
        sampled.append(memory(server))
