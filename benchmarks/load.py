"""Many devices in one cheap process: frames encoded beforehand, no more of WebSocket than the device protocol needs.

A masking key of zeros is as good as any other here and leaves the payload as it is.
"""

import asyncio
import heapq
import struct
import time
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import numpy as np

from tracemesh.wire.device import Ack, ErrorMessage, Welcome, to_device

RATE, BATCH = 100, 10
"""Samples a second of each device, and samples a message."""
PERIOD = BATCH / RATE
"""s between two messages of a device."""
REQUEST = (
    "GET /api/v1/ingest HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dHJhY2VtZXNoJ3MgbG9hZA==\r\n\r\n"
)
STRIDE = 20
"""Ticks between two samples: 4 mm, so that each is one more point of the live view."""
TEXT, PING, PONG = 0x1, 0x9, 0xA


@dataclass
class Load:
    """What the devices saw: seconds until each acknowledgement, and how many messages were acknowledged."""

    waits: list[float] = field(default_factory=list)
    acknowledged: int = 0


class Device(asyncio.Protocol):
    """One device: says hello, then sends a message whenever it is told to."""

    def __init__(self, number: int, port: int, load: Load) -> None:
        """Nothing is sent before the connection is there."""
        loop = asyncio.get_running_loop()
        self.session: asyncio.Future[str] = loop.create_future()
        self.done: asyncio.Future[None] = loop.create_future()
        self.sent: list[float] = []
        self._number = number
        self._port = port
        self._load = load
        self._acknowledged = 0
        self._wanted = -1
        self._received = b""
        self._columns = _columns(np.random.default_rng(number))

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Ask for a WebSocket."""
        self._transport = cast(asyncio.Transport, transport)
        self._transport.write(REQUEST.format(port=self._port).encode())

    def send(self) -> None:
        """Send the next message now."""
        seq = len(self.sent)
        self.sent.append(time.perf_counter())
        if seq == 0:
            self._transport.write(_frame(TEXT, b'{"type":"curve.start","seq":0,"curve":0}'))
            return
        first = (seq - 1) * BATCH
        ticks = ",".join(f"[0,{STRIDE * sample}]" for sample in range(first, first + BATCH))
        head = f'{{"type":"samples","seq":{seq},"curve":0,"first_sample":{first},"ticks":[{ticks}],'
        self._transport.write(_frame(TEXT, head.encode() + self._columns))

    def expect(self, messages: int) -> None:
        """Be done once so many messages are acknowledged."""
        self._wanted = messages
        self._finish()

    def data_received(self, data: bytes) -> None:
        """Take the answer to the request, then frames."""
        self._received += data
        if self._received.startswith(b"HTTP"):
            if b"\r\n\r\n" not in self._received:
                return
            self._accepted()
        while len(self._received) >= 2 and len(self._received) >= (size := 2 + self._received[1]):
            frame, self._received = self._received[:size], self._received[size:]
            self._take(frame[0] & 0xF, frame[2:])

    def _accepted(self) -> None:
        head, _, self._received = self._received.partition(b"\r\n\r\n")
        if b" 101 " not in head.splitlines()[0]:
            self._fail(head.decode())
        hello = f'{{"type":"hello","recording":"r{self._number}","device":{{"id":"d","kind":"k","wheel":{{}}}}}}'
        self._transport.write(_frame(TEXT, hello.encode()))

    def connection_lost(self, exc: Exception | None) -> None:
        """Nobody hangs up but we."""
        self._fail(f"the server hung up: {exc}")

    def close(self) -> None:
        """Hang up."""
        self._transport.abort()

    def _take(self, kind: int, payload: bytes) -> None:
        if kind == PING:
            self._transport.write(_frame(PONG, payload))
        elif kind != TEXT:
            self._fail(repr(payload))
        elif payload.startswith(b'{"type":"ack","seq":'):
            self._acknowledge(int(payload[20:-1]))
        else:
            self._answer(to_device.validate_json(payload))

    def _answer(self, message: Welcome | Ack | ErrorMessage) -> None:
        if isinstance(message, Welcome):
            self.session.set_result(message.session)
        else:
            self._fail(str(message))

    def _acknowledge(self, seq: int) -> None:
        now = time.perf_counter()
        self._load.waits += [now - sent for sent in self.sent[self._acknowledged : seq + 1]]
        self._load.acknowledged += seq + 1 - self._acknowledged
        self._acknowledged = seq + 1
        self._finish()

    def _finish(self) -> None:
        if self._acknowledged == self._wanted and not self.done.done():
            self.done.set_result(None)

    def _fail(self, words: str) -> None:
        for future in (self.session, self.done):
            if not future.done():
                future.set_exception(RuntimeError(words))


async def connect(devices: int, port: int, load: Load) -> list[Device]:
    """Connect devices one after another; all have been welcomed then."""
    loop = asyncio.get_running_loop()
    connected = []
    for number in range(devices):
        _, device = await loop.create_connection(partial(Device, number, port, load), "127.0.0.1", port)
        await device.session
        connected.append(device)
    return connected


async def send(devices: list[Device], messages: int) -> None:
    """Every device sends so many messages, each at times of its own; returns when all are acknowledged."""
    begin = time.perf_counter()
    due = [(begin + PERIOD * number / len(devices), number) for number in range(len(devices))]
    while due:
        when, number = due[0]
        await asyncio.sleep(max(0.0, when - time.perf_counter()))
        devices[number].send()
        if len(devices[number].sent) < messages:
            heapq.heapreplace(due, (when + PERIOD, number))
        else:
            heapq.heappop(due)
            devices[number].expect(messages)
    await asyncio.gather(*(device.done for device in devices))


def _columns(chance: np.random.Generator) -> bytes:
    vectors = [chance.uniform(-1, 1, (BATCH, 3)).round(4).tolist() for _ in range(2)]
    return f'"time":{[0.0] * BATCH},"acceleration":{vectors[0]},"magnetic":{vectors[1]}}}'.replace(" ", "").encode()


def _frame(kind: int, payload: bytes) -> bytes:
    size = len(payload)
    length = struct.pack("!B", 0x80 | size) if size < 126 else struct.pack("!BH", 0x80 | 126, size)
    return bytes([0x80 | kind]) + length + bytes(4) + payload
