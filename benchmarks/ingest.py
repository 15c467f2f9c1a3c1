"""Devices on one server: how long an acknowledgement, which comes after the durable commit, takes."""

import asyncio
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import numpy as np
from websockets.asyncio.client import ClientConnection, connect

from benchmarks.data import Data
from benchmarks.table import Cell, Column, Table

RATE, BATCH = 100, 10
"""Samples a second of each device, and samples a message."""
PORT = 8799

COLUMNS = (
    Column("devices", "d"),
    Column("messages/s", ".0f"),
    *(Column(f"ack {name}, ms", ".1f") for name in ("p50", "p95", "p99", "max")),
    Column("lost", "d"),
    Column("server, s of processor a s", ".2f"),
    Column("server memory, MB", ".0f"),
)
NOTES = (
    f"""Every device sends {RATE} samples a second (acceleration, magnetic field, ticks, time) in messages of {BATCH} to
    one server process on SQLite, synchronous=FULL; the load generator shares the machine. Ack: from sending a message
    to its acknowledgement. Lost: messages that the server does not have at the end.""",
)


def ingest(data: Data, devices: tuple[int, ...] = (100, 300, 500), seconds: float = 20.0) -> Table:
    """Table of one row per number of devices. `data` is not needed."""
    rows = tuple(_row(count, seconds) for count in devices)
    return Table("ingest", "Devices on one server", COLUMNS, rows, NOTES)


@dataclass
class Load:
    """What the devices saw: seconds until each acknowledgement, and how many messages were acknowledged."""

    waits: list[float] = field(default_factory=list)
    acknowledged: int = 0


def _row(devices: int, seconds: float) -> tuple[Cell, ...]:
    messages = round(seconds * RATE / BATCH)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(PORT), "--data-dir", folder]
        server = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        try:
            _wait_for_server()
            load, busy, elapsed = asyncio.run(_all_devices(server.pid, devices, messages))
            memory = _memory(server.pid)
        finally:
            server.terminate()
            server.wait()
    quantiles = (float(q) for q in 1000 * np.quantile(load.waits, (0.5, 0.95, 0.99, 1.0)))
    lost = devices * (messages + 1) - load.acknowledged
    return (devices, len(load.waits) / elapsed, *quantiles, lost, busy / elapsed, memory)


async def _all_devices(server: int, devices: int, messages: int) -> tuple[Load, float, float]:
    """Connect all, then begin: what they saw, the server's processor time and the time that passed, s."""
    load, ready, begin = Load(), asyncio.Semaphore(0), asyncio.Event()
    tasks = [asyncio.create_task(_device(number, messages, load, ready, begin)) for number in range(devices)]
    for _ in tasks:
        await ready.acquire()
    busy, start = _processor_time(server), time.perf_counter()
    begin.set()
    await asyncio.gather(*tasks)
    return load, _processor_time(server) - busy, time.perf_counter() - start


async def _device(number: int, messages: int, load: Load, ready: asyncio.Semaphore, begin: asyncio.Event) -> None:
    chance = np.random.default_rng(number)
    await asyncio.sleep(chance.uniform(0, 2))
    async with connect(f"ws://127.0.0.1:{PORT}/api/v1/ingest", compression=None, open_timeout=60) as socket:
        hello = {"type": "hello", "recording": f"r{number}", "device": {"id": "d", "kind": "k", "wheel": {}}}
        await socket.send(json.dumps(hello))
        await socket.recv()
        ready.release()
        await begin.wait()
        await asyncio.sleep(chance.uniform(0, BATCH / RATE))
        sent: list[float] = []
        listening = asyncio.create_task(_listen(socket, sent, messages, load))
        await _send(socket, sent, messages, chance)
        await listening


async def _send(socket: ClientConnection, sent: list[float], messages: int, chance: np.random.Generator) -> None:
    vectors = {name: chance.uniform(-1, 1, (BATCH, 3)).round(4).tolist() for name in ("acceleration", "magnetic")}
    columns = json.dumps({**vectors, "time": [0.0] * BATCH, "ticks": [[1, 2]] * BATCH})[1:]
    start = time.perf_counter()
    for number in range(messages + 1):
        await asyncio.sleep(max(0.0, start + number * BATCH / RATE - time.perf_counter()))
        sent.append(time.perf_counter())
        if number == 0:
            await socket.send('{"type":"curve.start","seq":0,"curve":0}')
        else:
            head = f'{{"type":"samples","seq":{number},"curve":0,"first_sample":{(number - 1) * BATCH},'
            await socket.send(head + columns)


async def _listen(socket: ClientConnection, sent: list[float], messages: int, load: Load) -> None:
    next_seq = 0
    async for text in socket:
        answer, now = json.loads(text), time.perf_counter()
        if answer["type"] != "ack":
            raise RuntimeError(text)
        load.waits += [now - sent[seq] for seq in range(next_seq, answer["seq"] + 1)]
        load.acknowledged += answer["seq"] + 1 - next_seq
        next_seq = answer["seq"] + 1
        if next_seq == messages + 1:
            return


def _wait_for_server() -> None:
    deadline = time.monotonic() + 30
    while True:
        try:
            urlopen(f"http://127.0.0.1:{PORT}/healthz").close()
            return
        except URLError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.05)


def _processor_time(pid: int) -> float:
    """Seconds of processor time of a process (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100


def _memory(pid: int) -> float:
    """Resident memory of a process, MB (Linux)."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1000
