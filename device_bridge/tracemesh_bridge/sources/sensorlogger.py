"""Sensor Logger, an app for iOS and Android that posts what it measures: https://www.tszheichoi.com/sensorlogger.

A status of 499 makes the app show the answer's text to its user, once per recording: whatever the user must change is
said there.

The payload does not tell iOS from Android, whose conventions differ unless the app's "Standardise Units & Frames" is
on; gravity does (see `_Convention`).
"""

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from tracemesh.wire.base import Quaternion, Vector
from tracemesh.wire.device import Device
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.health import Host
from tracemesh_bridge.phone import Assembler, Sensor
from tracemesh_bridge.pose import QUARTER_TURN, TOLERANCE, product, unit, upwards
from tracemesh_bridge.source import LinkState, Reading
from tracemesh_bridge.sources.sensorlogger_batches import Batch, Entry, Reorder, parse_batch

MAX_BODY = 16_000_000
STALE_AFTER = 5.0
SHOWN_TO_USER = 499
VECTORS: dict[str, Sensor] = {"magnetometer": "magnetic", "gyroscope": "rotation_rate"}


class SensorLogger:
    """The app as a source of readings: a small web server that the app posts to."""

    def __init__(self, address: tuple[str, int], device: Device, host: Host) -> None:
        """Listens at once, so that a taken port is known before anything else. Raises BridgeError."""
        self.device = device
        self._host = host
        self._batches: queue.Queue[Batch] = queue.Queue(maxsize=1000)
        self._order = Reorder(host.health)
        self._phone = ""
        self._translator = Translator(host)
        try:
            self._server = ThreadingHTTPServer(address, _handler(self._post))
        except OSError as error:
            raise BridgeError(f"cannot listen at {address[0]}:{address[1]}: {error.strerror}") from error
        self.port = self._server.server_port

    def readings(self, stop: threading.Event) -> Iterator[Reading]:
        """One reading for each orientation, in the order measured, until `stop` is set."""
        self._host.link.to(LinkState.SEARCHING, f"waiting for the app at port {self.port} of this computer")
        with self._listening():
            silent_since = self._host.clock.now()
            while not stop.is_set():
                try:
                    batches = self._order.add(self._batches.get(timeout=0.2))
                except queue.Empty:
                    batches = self._order.late(self._host.clock.now())
                for batch in batches:
                    silent_since = batch.received
                    yield from self._translator.readings(batch)
                if self._host.clock.now() - silent_since > STALE_AFTER and self._host.link.state is LinkState.LIVE:
                    self._host.link.to(LinkState.STALE, "nothing was posted; is the app still recording?")

    def _post(self, body: bytes) -> tuple[int, str]:
        """Status and text of the answer to a POST."""
        try:
            batch = parse_batch(body, self._host.clock.now())
        except BridgeError as error:
            self._host.health.fault("malformed")
            return SHOWN_TO_USER, str(error)
        self._phone = self._phone or batch.phone
        if batch.phone != self._phone:
            return SHOWN_TO_USER, f"this bridge records phone {self._phone}; start another one for {batch.phone}"
        try:
            self._batches.put_nowait(batch)
        except queue.Full:
            return SHOWN_TO_USER, "the bridge cannot keep up: lower the sampling rate"
        missing = {"orientation", "gravity"} - {e.name for e in batch.entries}
        if missing and batch.entries:
            return SHOWN_TO_USER, f"switch on the sensors {' and '.join(sorted(missing))} in Sensor Logger"
        return 200, "stored"

    @contextmanager
    def _listening(self) -> Iterator[None]:
        thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        try:
            yield
        finally:
            self._server.shutdown()
            thread.join()
            self._server.server_close()


class Translator:
    """Makes readings of what the app posts, whichever convention the phone speaks."""

    def __init__(self, host: Host) -> None:
        """`host` is told of the phone and of what is wrong with it."""
        self._host = host
        self._convention = _Convention()
        self._assembler = Assembler(host.health, host.link.note)
        self._gravity: Vector | None = None
        self._acceleration: Vector | None = None

    def readings(self, batch: Batch) -> Iterator[Reading]:
        """One reading for each orientation of a POST."""
        for entry in sorted(batch.entries, key=lambda e: e.time):
            reading = self._take(entry, batch.received)
            if reading is not None:
                self._host.link.to(LinkState.LIVE, f"phone {batch.phone}")
                yield reading

    def _take(self, entry: Entry, received: float) -> Reading | None:
        v = entry.values
        if entry.name == "gravity":
            self._gravity = (v["x"], v["y"], v["z"])
        elif entry.name == "accelerometer" and self._gravity is not None:
            x, y, z = (v[axis] + g for axis, g in zip("xyz", self._gravity, strict=True))
            self._acceleration = (x, y, z)
        elif entry.name in VECTORS:
            self._assembler.sense(VECTORS[entry.name], (v["x"], v["y"], v["z"]))
        elif entry.name == "orientation":
            quaternion = (v["qw"], v["qx"], v["qy"], v["qz"])
            self._convention.learn(quaternion, self._gravity)
            if self._acceleration is not None:
                self._assembler.sense("acceleration", self._convention.force(self._acceleration))
            return self._assembler.orient(entry.time / 1e9, self._convention.rotation(quaternion), received)
        return None


class _Convention:
    """Which of two conventions a phone speaks; what gravity says about a quaternion decides.

    Android, and iOS when standardised: gravity is +z on a phone lying flat, the quaternion maps to ENU. iOS as it is:
    gravity is -z, the quaternion maps to a world with x (true) North, y West, z up.
    """

    def __init__(self) -> None:
        self._apple = False

    def learn(self, quaternion: Quaternion, gravity: Vector | None) -> None:
        """Look at one orientation and the newest gravity."""
        rotation = unit(quaternion)
        if rotation is None or gravity is None:
            return
        up = upwards(rotation, gravity)
        if abs(up) > TOLERANCE:
            self._apple = up < 0

    def rotation(self, quaternion: Quaternion) -> Quaternion:
        """Device to ENU."""
        return product(QUARTER_TURN, quaternion) if self._apple else quaternion

    def force(self, acceleration: Vector) -> Vector:
        """Specific force, up at rest."""
        x, y, z = acceleration
        return (-x, -y, -z) if self._apple else acceleration


def _handler(post: Callable[[bytes], tuple[int, str]]) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        timeout = 10

        def do_POST(self) -> None:
            try:
                length = int(self.headers.get("Content-Length", ""))
            except ValueError:
                length = -1
            if not 0 <= length <= MAX_BODY:
                self._answer(413, f"wanted at most {MAX_BODY} bytes and their number")
                return
            self._answer(*post(self.rfile.read(length)))

        def do_GET(self) -> None:
            self._answer(200, "tracemesh-bridge listens: give this address to Sensor Logger as its HTTP Push URL")

        def log_message(self, *_: object) -> None:
            """The bridge has its own log."""

        def _answer(self, status: int, text: str) -> None:
            data = text.encode()
            self.send_response(status)
            self.send_header("Content-Type", "text/plain; charset=utf-8")
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

    return Handler
