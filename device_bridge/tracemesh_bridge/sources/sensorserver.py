"""SensorServer, an Android app that is a WebSocket server: https://github.com/umer0586/SensorServer (6.4).

One JSON text per sensor event: {"type", "values", "timestamp" (ns since boot), "accuracy"}. The rotation vector is
[x, y, z, w, heading accuracy], device to ENU; accelerations include gravity (flat: z = +9.8).
"""

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.sync.client import ClientConnection, connect

from tracemesh.wire.base import Quaternion
from tracemesh.wire.device import Device
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.health import Host
from tracemesh_bridge.phone import Assembler, Sensor
from tracemesh_bridge.pose import from_vector_part
from tracemesh_bridge.source import LinkState, Reading

PREFIX = "android.sensor."
ORIENTATIONS = ("rotation_vector", "game_rotation_vector", "geomagnetic_rotation_vector")
VECTORS: dict[str, Sensor] = {
    "accelerometer": "acceleration",
    "magnetic_field": "magnetic",
    "gyroscope": "rotation_rate",
}
CLOSED = {
    4001: "the phone has no such sensor",
    4002: "this app does not know the path: is it SensorServer 6?",
    4003: "the app wants a sensor named",
    4004: "the server in the app was stopped",
    4005: "the connection was closed in the app",
    4006: "the app did not understand the list of sensors",
    4007: "the app wants more than one sensor in a list",
    4008: "the app wants sensors named",
    4009: "the app may not read this sensor: grant it the permission",
}
"""The app's own close codes, in words."""
STALE_AFTER, LOST_AFTER, SEARCH_PERIOD = 1.0, 10.0, 1.0
SLOW = 20.0
"""Samples per second below which it is said how to raise the rate: the app's default is 5."""


@dataclass(frozen=True)
class SensorServerSettings:
    """address: host:port as the app shows it; sensors: their Android names without the prefix."""

    address: str
    sensors: tuple[str, ...] = ("rotation_vector", "accelerometer", "magnetic_field", "gyroscope")


class SensorServer:
    """The app as a source of readings."""

    def __init__(self, settings: SensorServerSettings, device: Device, host: Host) -> None:
        """Raises BridgeError if the sensors tell no orientation."""
        self.device = device
        self._url = sensor_url(settings)
        self._only = PREFIX + settings.sensors[0]
        self._raw = not _gives_orientation(settings)
        self._host = host
        self._link = host.link
        self._assembler = Assembler(host.health, host.link.note)

    def readings(self, stop: threading.Event) -> Iterator[Reading]:
        """One reading for each rotation vector, without any for each of the gyroscope's, until `stop` is set.

        Connects again when the phone is lost.
        """
        while not stop.is_set():
            self._link.to(LinkState.OPENING, self._url)
            try:
                with connect(self._url, open_timeout=5, close_timeout=1, compression=None, proxy=None) as socket:
                    yield from self._events(socket, stop)
            except (OSError, InvalidHandshake, InvalidURI, ConnectionClosed) as error:
                self._link.down(_words(error))
            stop.wait(SEARCH_PERIOD)

    def _events(self, socket: ClientConnection, stop: threading.Event) -> Iterator[Reading]:
        silent = 0.0
        while not stop.is_set():
            try:
                text = socket.recv(timeout=STALE_AFTER)
            except TimeoutError:
                silent += STALE_AFTER
                if silent >= LOST_AFTER:
                    self._link.down("the phone has gone silent: keep its screen on")
                    return
                self._link.to(LinkState.STALE, "no sample; does the phone sleep? keep its screen on")
                continue
            reading = self.take(text)
            if reading is not None:
                silent = 0.0
                self._link.to(LinkState.LIVE, self._url)
                self._advise(reading.received)
                yield reading

    def take(self, text: str | bytes) -> Reading | None:
        """The reading that a message of the app completes, if it does."""
        received = self._host.clock.now()
        try:
            event = parse_event(text, self._only)
        except BridgeError:
            self._host.health.fault("malformed")
            return None
        if event.sensor in VECTORS and len(event.values) >= 3:
            self._assembler.sense(VECTORS[event.sensor], (event.values[0], event.values[1], event.values[2]))
        if event.sensor in ORIENTATIONS:
            return self._assembler.orient(event.time, rotation(event.values), received)
        return self._assembler.raw(event.time, received) if self._raw and event.sensor == "gyroscope" else None

    def _advise(self, now: float) -> None:
        if self._host.health.received == 50 and self._host.health.rate(now) < SLOW:
            self._link.note("few samples: set the sampling period in the app to 10000 microseconds, then restart it")


@dataclass(frozen=True)
class Event:
    """What one sensor said. time: s since the phone was booted."""

    sensor: str
    time: float
    values: tuple[float, ...]


def sensor_url(settings: SensorServerSettings) -> str:
    """Where the app serves these sensors: its address for one differs from that for several. Raises BridgeError."""
    if not _gives_orientation(settings) and not VECTORS.keys() <= set(settings.sensors):
        wanted, raw, got = (", ".join(names) for names in (ORIENTATIONS, VECTORS, settings.sensors))
        raise BridgeError(f"wanted one of {wanted} among the sensors, or all of {raw}, got {got}")
    names = [PREFIX + s for s in settings.sensors]
    base = f"ws://{settings.address.removeprefix('ws://').rstrip('/')}"
    if len(names) == 1:
        return f"{base}/sensor/connect?type={names[0]}"
    return f"{base}/sensors/connect?types={quote(json.dumps(names, separators=(',', ':')))}"


def _gives_orientation(settings: SensorServerSettings) -> bool:
    return any(s in ORIENTATIONS for s in settings.sensors)


def parse_event(text: str | bytes, only: str) -> Event:
    """One message of the app; `only` is the sensor meant by a message that names none. Raises BridgeError."""
    try:
        message = json.loads(text)
        return _event(message, only)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
        raise BridgeError(f"wanted a sensor event, got {text[:80]!r}") from error


def rotation(values: tuple[float, ...]) -> Quaternion:
    """Android's [x, y, z, w, ...] as [w, x, y, z]; [x, y, z] has a w that is not negative. All zero if too short."""
    if len(values) == 3:
        return from_vector_part(*values)
    return (values[3], values[0], values[1], values[2]) if len(values) > 3 else (0.0, 0.0, 0.0, 0.0)


def _event(message: dict[str, Any], only: str) -> Event:
    values = tuple(float(v) for v in message["values"])
    if any(v - v != 0 for v in values):
        raise ValueError("not finite")
    name = str(message.get("type", only)).lower().removeprefix(PREFIX)
    return Event(name, int(message["timestamp"]) / 1e9, values)


def _words(error: Exception) -> str:
    if isinstance(error, ConnectionClosed):
        code = error.rcvd.code if error.rcvd else None
        return CLOSED.get(code or 0, "the connection broke; is the phone asleep or out of reach?")
    return str(error) or type(error).__name__
