"""Runs a calibration: readings from a source, Enter from the operator, the result into a file and to a server."""

import json
import os
import queue
import sys
import threading
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.request import ProxyHandler, Request, build_opener

from tracemesh.formats.calibrations import read_calibration, write_calibration
from tracemesh.wire.calibration import Calibration
from tracemesh_bridge.calibration import Procedure
from tracemesh_bridge.console import Console
from tracemesh_bridge.errors import BridgeError, OperatorMistake
from tracemesh_bridge.record import TOKEN_VARIABLE
from tracemesh_bridge.source import Reading, Source
from tracemesh_bridge.uplink import ingest_url

PATIENCE = 0.2
"""s between two looks at the status."""
Event = Reading | BaseException | None
"""What may happen: a reading, the end of the source, or Enter (None)."""


def run(source: Source, procedure: Procedure, console: Console) -> Calibration:
    """Lead the operator through all steps. Raises BridgeError if the keys or the source end before, ScanError if the
    readings do not tell enough.
    """
    events: queue.Queue[Event] = queue.Queue()
    stop = threading.Event()
    reader = threading.Thread(target=_read, args=(source, stop, events))
    reader.start()
    threading.Thread(target=_listen, args=(events,), daemon=True).start()  # may wait for Enter for ever
    try:
        console.say(procedure.words)
        while not procedure.over:
            _next(events, procedure, console)
    finally:
        stop.set()
        reader.join()
        console.status(str)  # nothing any more
    return procedure.result()


def _next(events: queue.Queue[Event], procedure: Procedure, console: Console) -> None:
    try:
        event = events.get(timeout=PATIENCE)
    except queue.Empty:
        console.status(procedure.status)
        return
    if isinstance(event, BaseException):
        raise event
    if event is not None:
        if words := procedure.take(event):
            console.say(words)
        if events.empty():
            console.status(procedure.status)
        return
    try:
        procedure.enter()
    except OperatorMistake as mistake:
        console.say(f"\a{mistake}")
    if not procedure.over:
        console.say(procedure.words)


def _read(source: Source, stop: threading.Event, events: queue.Queue[Event]) -> None:
    try:
        for reading in source.readings(stop):
            if isinstance(reading, Reading):  # an array's sensors are calibrated one by one
                events.put(reading)
    except Exception as error:  # whatever it is, the operator must hear of it
        events.put(error)


def _listen(events: queue.Queue[Event]) -> None:
    for _ in sys.stdin:
        events.put(None)
    events.put(BridgeError("the keys ended before the calibration was complete; nothing was written"))


def save(calibration: Calibration, path: Path) -> None:
    """Write a calibration. Raises BridgeError."""
    try:
        path.write_text(write_calibration(calibration))
    except OSError as error:
        raise BridgeError(f"cannot write {path}: {error.strerror}") from error


def send(calibration: Calibration, kind: str, server: str) -> Calibration:
    """Give a calibration to a server; as it is there, with its version. Raises BridgeError with the server's words."""
    scheme, _, rest = ingest_url(server).partition("://")
    base = f"{'https' if scheme == 'wss' else 'http'}://{rest.removesuffix('/ingest')}"
    body = json.dumps({"calibration": calibration.model_dump(mode="json"), "kind": kind}).encode()
    headers = {"Content-Type": "application/json"}
    if token := os.environ.get(TOKEN_VARIABLE):
        headers["Authorization"] = f"Bearer {token}"
    request = Request(f"{base}/devices/{calibration.device}/calibrations", body, headers)
    try:
        with build_opener(ProxyHandler({})).open(request, timeout=10) as answer:
            return read_calibration(answer.read().decode())
    except HTTPError as error:
        with error:
            raise BridgeError(f"{server} did not take it: HTTP {error.code} {error.read(500).decode()}") from error
    except (URLError, OSError, TimeoutError) as error:
        raise BridgeError(f"{server} did not take it: {error}") from error
