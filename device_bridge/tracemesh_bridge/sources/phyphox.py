"""phyphox, an app for iOS and Android whose experiments can be watched over HTTP: https://phyphox.org.

Asked "what came since T", never with two requests at once. Its attitude sensor is device to ENU on both systems, its
accelerometer includes gravity with Android's sign on both. Which buffers hold them is asked of the experiment.
"""

import http.client
import json
import reprlib
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.error import URLError
from urllib.parse import quote
from urllib.request import ProxyHandler, build_opener

from tracemesh.wire.device import Device
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.health import Host
from tracemesh_bridge.phone import Assembler, Sensor
from tracemesh_bridge.source import LinkState, Reading

POLL, IDLE = 0.03, 0.25
"""s between two requests while the experiment runs, and while it does not: what the app's own page does."""
TIMEOUT = 10.0
LOST_AFTER = 3
"""Failed requests in a row after which the phone is lost."""
MAX_ANSWER = 50_000_000
ATTITUDE = ("t", "abs", "x", "y", "z")
SENSORS: dict[str, Sensor] = {
    "accelerometer": "acceleration",
    "magnetic_field": "magnetic",
    "gyroscope": "rotation_rate",
}
NEVER = float("-inf")
SILENT = 2.0
"""s without anything new after which it is asked whether the experiment was cleared and its time began again."""
_Row = tuple[float, ...]


@dataclass(frozen=True)
class Input:
    """A sensor of the experiment, and the buffers that its time and values go to."""

    source: str
    buffers: tuple[str, ...]


class Phyphox:
    """The app as a source of readings."""

    def __init__(self, address: str, device: Device, host: Host) -> None:
        """`address`: as the app shows it, such as http://192.168.0.7:8080."""
        self.device = device
        self._base = (address if "//" in address else f"http://{address}").rstrip("/")
        self._host = host
        self._assembler = Assembler(host.health, host.link.note)
        self._open = build_opener(ProxyHandler({})).open  # a phone in the room is not behind a proxy

    def readings(self, stop: threading.Event) -> Iterator[Reading]:
        """One reading for each attitude, until `stop` is set; asks again when the phone or the experiment is lost."""
        while not stop.is_set():
            self._host.link.to(LinkState.OPENING, self._base)
            try:
                yield from self._experiment(find_inputs(self._get("/config")), stop)
            except (OSError, URLError, http.client.HTTPException, BridgeError) as error:
                self._host.link.down(str(error) or type(error).__name__)
            stop.wait(1.0)

    def _experiment(self, inputs: tuple[Input, ...], stop: threading.Event) -> Iterator[Reading]:
        since = dict.fromkeys(inputs, NEVER)
        session, newest = "", self._host.clock.now()
        while not stop.is_set():
            answer = self._patient(query(since), stop)
            received = self._host.clock.now()
            status = parse_status(answer)
            if session and status.session != session:
                self._host.link.note("another experiment was opened")
                return
            session = status.session
            before = dict(since)
            yield from self.read(answer, since, received)
            if since != before:
                newest = received
            elif received - newest > SILENT and self._began_again(inputs[0], since):
                since, newest = dict.fromkeys(inputs, NEVER), received
            if not status.measuring:
                self._host.link.to(LinkState.STALE, "the experiment does not run: press play on the phone")
            stop.wait(POLL if status.measuring else IDLE)

    def read(self, answer: Any, since: dict[Input, float], received: float) -> Iterator[Reading]:
        """Readings of what came after `since` (s), which moves on. Raises BridgeError."""
        rows = [(row, i) for i in since for row in parse_rows(answer, i, since[i])]
        for row, i in sorted(rows, key=lambda r: r[0][0]):
            since[i] = row[0]
            if i.source in SENSORS:
                self._assembler.sense(SENSORS[i.source], (row[1], row[2], row[3]))
                continue
            reading = self._assembler.orient(row[0], (row[1], row[2], row[3], row[4]), received)
            if reading is not None:
                self._host.link.to(LinkState.LIVE, self._base)
                yield reading

    def _began_again(self, attitude: Input, since: dict[Input, float]) -> bool:
        newest = parse_rows(self._get(query({attitude: NEVER})), attitude, NEVER)
        return bool(newest) and newest[-1][0] < since[attitude]

    def _patient(self, path: str, stop: threading.Event) -> Any:
        """An answer, even if the phone misses a request or two."""
        for attempt in range(1, LOST_AFTER + 1):
            try:
                return self._get(path)
            except (OSError, URLError, http.client.HTTPException):
                self._host.health.fault("late")
                if attempt == LOST_AFTER:
                    raise
                stop.wait(IDLE)
        raise AssertionError

    def _get(self, path: str) -> Any:
        with self._open(self._base + path, timeout=TIMEOUT) as response:
            return parse(response.read(MAX_ANSWER))


@dataclass(frozen=True)
class Status:
    """Which run of the experiment answers, and whether it measures."""

    session: str
    measuring: bool


def find_inputs(config: Any) -> tuple[Input, ...]:
    """The sensors of an experiment that we can use, the attitude first. Raises BridgeError if it has none."""
    try:
        inputs = [(str(i["source"]), _outputs(i)) for i in config["inputs"]]
        title = str(config.get("title", ""))
    except (TypeError, KeyError, AttributeError) as error:
        raise BridgeError(f"wanted phyphox's description of an experiment, got {_begin(config)}") from error
    wanted = {"attitude": ATTITUDE, **dict.fromkeys(SENSORS, ("t", "x", "y", "z"))}
    usable = [Input(s, tuple(o[k] for k in wanted[s])) for s, o in inputs if s in wanted and set(wanted[s]) <= set(o)]
    if not any(i.source == "attitude" for i in usable):
        sensors = ", ".join(s for s, _ in inputs) or "no sensor"
        raise BridgeError(f"open an experiment that records the attitude sensor; {title!r} records {sensors}")
    return tuple(sorted(usable, key=lambda i: i.source != "attitude"))


def query(since: dict[Input, float]) -> str:
    """The request for everything that came after the given times."""
    parts = []
    for i, time in since.items():
        for buffer in i.buffers:
            reference = "" if buffer == i.buffers[0] else f"|{i.buffers[0]}"
            threshold = f"{time!r}{reference}" if time > NEVER else "full"
            parts.append(f"{quote(buffer, safe='')}={quote(threshold, safe='')}")
    return "/get?" + "&".join(parts)


def parse(body: bytes) -> Any:
    """JSON from the app. Raises BridgeError."""
    try:
        return json.loads(body)
    except (ValueError, RecursionError) as error:
        raise BridgeError(f"wanted JSON from phyphox, got {body[:80]!r}") from error


def parse_status(answer: Any) -> Status:
    """The state of the experiment. Raises BridgeError."""
    try:
        return Status(str(answer["status"]["session"]), bool(answer["status"]["measuring"]))
    except (TypeError, KeyError) as error:
        raise BridgeError(f"wanted buffers from phyphox, got {_begin(answer)}") from error


def parse_rows(answer: Any, i: Input, since: float) -> list[_Row]:
    """What came after `since` (s): rows of time and values, whole ones only. Raises BridgeError."""
    try:
        columns = [answer["buffer"][name]["buffer"] for name in i.buffers]
        rows = [tuple(float(v) for v in row) for row in zip(*columns, strict=False) if None not in row]
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        raise BridgeError(f"wanted the buffers {', '.join(i.buffers)} from phyphox, got {_begin(answer)}") from error
    return [row for row in rows if row[0] > since and all(v - v == 0 for v in row)]


def _begin(answer: Any) -> str:
    """How an answer begins, for people; one may be nested deeper than Python prints."""
    return reprlib.repr(answer)[:80]


def _outputs(description: Any) -> dict[str, str]:
    return {str(k): str(v) for output in description.get("outputs", ()) for k, v in output.items()}
