"""A fixed array behind a program that prints its readings: one JSON object a line, whatever the hardware speaks.

`{"time": s, "acceleration": [[x, y, z], ...], "magnetic": [[x, y, z], ...]}` or, instead of the vectors,
`"quaternion": [[w, x, y, z], ...]`: one row per sensor. Lines that are no such reading are counted and left out.
"""

import json
import select
import subprocess
import threading
from collections.abc import Iterator, Sequence

from pydantic import ValidationError

from tracemesh.wire.arrays import ArrayReading, misfit
from tracemesh.wire.device import Device
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.health import Host
from tracemesh_bridge.source import LinkState, Reading

PATIENCE = 0.1
"""s between two looks whether to stop."""
MAX_LINE = 2**22
"""Bytes after which a line is given up."""


class Program:
    """An array whose readings a program prints."""

    def __init__(self, command: Sequence[str], device: Device, host: Host) -> None:
        """`command`: the program and its arguments."""
        self.device = device
        self._command = list(command)
        self._host = host
        self._said = ""

    def readings(self, stop: threading.Event) -> Iterator[ArrayReading]:
        """Every reading until the program ends or `stop` is set; raises BridgeError if it cannot start or fails."""
        try:
            program = subprocess.Popen(self._command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, bufsize=0)
        except OSError as error:
            raise BridgeError(f"cannot start {self._command[0]}: {error.strerror}") from error
        with program:
            try:
                yield from self._read(program, stop)
            finally:
                program.terminate()
        if program.returncode and not stop.is_set():
            raise BridgeError(f"{self._command[0]} ended with status {program.returncode}")

    def _read(self, program: "subprocess.Popen[bytes]", stop: threading.Event) -> Iterator[ArrayReading]:
        assert program.stdout is not None
        rest = b""
        while not stop.is_set():
            if not select.select([program.stdout], [], [], PATIENCE)[0]:
                continue
            if not (data := program.stdout.read(2**16)):
                program.wait()
                return
            *lines, rest = (rest + data).split(b"\n")
            rest = rest if len(rest) < MAX_LINE else b""
            yield from (reading for reading in map(self.take, lines) if reading is not None)

    def take(self, line: bytes) -> ArrayReading | None:
        """The reading in a line, if it is one."""
        received = self._host.clock.now()
        try:
            reading = ArrayReading.model_validate({**json.loads(line), "seq": 0, "received": received})
            why = misfit(self.device.array, reading)
        except ValidationError as error:
            why = error.errors()[0]["msg"]
        except (ValueError, TypeError, RecursionError):
            why = "wanted a JSON object"
        if why:
            self._bad(why)
            return None
        self._host.link.to(LinkState.LIVE, f"{reading.count} sensors")
        acceleration, magnetic = (c[0] if c else None for c in (reading.acceleration, reading.magnetic))
        self._host.health.take(Reading(received, reading.time, acceleration=acceleration, magnetic=magnetic))
        return reading

    def _bad(self, why: str) -> None:
        """Count a line that is no reading; say so once for each reason."""
        self._host.health.fault("malformed")
        if why != self._said:
            self._said = why
            self._host.link.note(f"a line that is no reading was left out: {why}")
