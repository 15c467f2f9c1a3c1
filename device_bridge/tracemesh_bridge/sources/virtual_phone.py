"""A virtual phone: behaves as one of the apps does, while it is moved along the curves of a built-in shape.

What it measures comes from the same simulated ride as the virtual Morphorider's; a phone has no odometer, but a fused
orientation. `SensorServer` and phyphox are servers, Sensor Logger posts.
"""

import json
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Literal
from urllib.error import URLError
from urllib.parse import parse_qs, parse_qsl, urlsplit
from urllib.request import ProxyHandler, Request, build_opener

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from tracemesh.geometry.simulated.simulation import ScanPlan
from tracemesh_bridge.phone import MOUNTING
from tracemesh_bridge.pose import GRAVITY
from tracemesh_bridge.sources.operator import Operator, operator_keys, ride_plan
from tracemesh_bridge.sources.virtual import say

Floats = NDArray[np.float64]
MICROTESLA = 50.0
BATCH_PERIOD = 0.2
CLOCK_JUMP_AT = 10.0
CLOCKS = {"sensorserver": 86_400.0, "sensorlogger": 1_790_000_000.0, "phyphox": 0.0}
"""s that an app's clock shows when the ride begins: since the phone was booted, 1970, the experiment began."""


@dataclass(frozen=True)
class VirtualPhoneSettings:
    """What the phone does. port: to serve at (0: any); url: to post to; rate: samples per second of the ride's time;
    repeat, reorder: probability that a post is sent again, or after the next one; clock_jump: s by which its clock is
    set, CLOCK_JUMP_AT s after the ride began.
    """

    app: Literal["sensorserver", "sensorlogger", "phyphox"]
    port: int = 0
    url: str = ""
    shape: str = "leaf"
    speed: float = 1.0
    rate: float = 100.0
    seed: int = 0
    noise: float = 1.0
    repeat: float = 0.0
    reorder: float = 0.0
    clock_jump: float = 0.0


@dataclass(frozen=True)
class PhoneSample:
    """time: s, the phone's clock; quaternion [x, y, z, w]: device to ENU; vectors in m/s^2 and microtesla."""

    time: float
    quaternion: list[float]
    acceleration: list[float]
    magnetic: list[float]


class Phone:
    """Everything that the phone has measured so far; it begins when first asked."""

    def __init__(self, settings: VirtualPhoneSettings) -> None:
        """Raises BridgeError if there is no such shape."""
        self.plan = ride_plan(settings.shape, settings.noise, settings.seed)
        self._settings = settings
        self._generator = np.random.default_rng(settings.seed)
        self._samples: list[PhoneSample] = []
        self._began: float | None = None
        self._lock = threading.Lock()

    @property
    def time(self) -> float:
        """s of the ride."""
        return 0.0 if self._began is None else (time.monotonic() - self._began) * self._settings.speed

    def samples(self, first: int) -> list[PhoneSample]:
        """The samples from number `first` on."""
        with self._lock:
            self._began = time.monotonic() if self._began is None else self._began
            times = np.arange(len(self._samples), int(self.time * self._settings.rate)) / self._settings.rate
            if len(times):
                self._samples += self._measure(times)
            return self._samples[first:]

    def _measure(self, times: Floats) -> list[PhoneSample]:
        raw = self.plan.readings(times, self._generator)
        mounting = Rotation.from_quat(MOUNTING, scalar_first=True)
        up, field = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (raw.acceleration, raw.magnetic))
        rotation = attitude(up, field) * mounting.inv()
        clock = (
            CLOCKS[self._settings.app]
            + times
            + np.where(times > self.plan.duration / 2, self._settings.clock_jump, 0.0)
        )
        rows = zip(
            clock.tolist(),
            rotation.as_quat(canonical=True).tolist(),
            (GRAVITY * mounting.apply(up)).tolist(),
            (MICROTESLA * mounting.apply(field)).tolist(),
            strict=True,
        )
        return [PhoneSample(*row) for row in rows]


def attitude(up: Floats, field: Floats) -> Rotation:
    """Rotation of (t, N, B) to a world with z up and the field over x: TRIAD. up, field: (n, 3) unit, in (t, N, B)."""
    along = field - np.sum(field * up, axis=1, keepdims=True) * up
    x = along / np.linalg.norm(along, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([x, np.cross(up, x), up], axis=1))


def run_virtual_phone(settings: VirtualPhoneSettings) -> None:
    """Be the phone until the ride is over. Raises BridgeError if there is no such shape."""
    phone = Phone(settings)
    {"sensorserver": _serve_websocket, "phyphox": _serve_http, "sensorlogger": _post}[settings.app](phone, settings)


def _ride(phone: Phone, plan: ScanPlan, each: Callable[[], object]) -> None:
    operator = Operator(operator_keys(plan))
    while not operator.over:
        each()
        time.sleep(0.01)
        operator.type_until(phone.time)
    time.sleep(1.0)  # for the bridge to let go


def _serve_websocket(phone: Phone, settings: VirtualPhoneSettings) -> None:
    def stream(connection: ServerConnection) -> None:
        assert connection.request is not None
        url = urlsplit(connection.request.path)
        query = parse_qs(url.query)
        wanted = json.loads(query["types"][0]) if "types" in query else query.get("type", [])
        if url.path == "/sensors/connect" and len(wanted) < 2:
            connection.close(4007, "too few sensors")
        sent = len(phone.samples(0))
        try:
            while True:
                for sample in phone.samples(sent):
                    sent += 1
                    for event in _events(sample, wanted):
                        connection.send(json.dumps(event))
                time.sleep(0.005)
        except ConnectionClosed:
            pass

    with serve(stream, "127.0.0.1", settings.port, compression=None) as server:
        say(f"virtual phone at 127.0.0.1:{server.socket.getsockname()[1]}")
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        _ride(phone, phone.plan, lambda: None)
        server.shutdown()


def _events(sample: PhoneSample, wanted: list[str]) -> list[dict[str, Any]]:
    values = {
        "android.sensor.accelerometer": sample.acceleration,
        "android.sensor.magnetic_field": sample.magnetic,
        "android.sensor.rotation_vector": [*sample.quaternion, -1.0],
    }
    stamp = round(sample.time * 1e9)
    return [{"type": t, "values": v, "timestamp": stamp, "accuracy": 3} for t, v in values.items() if t in wanted]


def _serve_http(phone: Phone, settings: VirtualPhoneSettings) -> None:
    outputs = [{"x": "qx"}, {"y": "qy"}, {"z": "qz"}, {"abs": "qw"}, {"t": "t"}]
    config = {"title": "Virtual phone", "inputs": [{"source": "attitude", "outputs": outputs}]}
    busy = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            assert busy.acquire(blocking=False), "two requests at once"
            url = urlsplit(self.path)
            answer = config if url.path == "/config" else _buffers(phone, dict(parse_qsl(url.query)))
            data = json.dumps(answer).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            busy.release()
            self.wfile.write(data)

        def log_message(self, *_: object) -> None:
            """Quiet."""

    with ThreadingHTTPServer(("127.0.0.1", settings.port), Handler) as server:
        say(f"virtual phone at http://127.0.0.1:{server.server_port}")
        threading.Thread(target=server.serve_forever, daemon=True).start()
        _ride(phone, phone.plan, lambda: None)
        server.shutdown()


def _buffers(phone: Phone, query: dict[str, str]) -> dict[str, Any]:
    """The answer to /get: what came after the threshold on t, with 8 significant digits."""
    threshold = query.get("t", "full")
    since = float("-inf") if threshold == "full" else float(threshold)
    since += 10.0 ** np.floor(np.log10(since / 1e7)) if since > 0 else 0.0  # as the app does: no sample comes twice
    samples = [s for s in phone.samples(0) if s.time > since]
    columns = {"t": [s.time for s in samples]}
    columns |= {name: [s.quaternion[i] for s in samples] for i, name in enumerate(("qx", "qy", "qz", "qw"))}
    digits = {name: [float(f"{v:.7e}") for v in column] for name, column in columns.items()}
    buffers = {k: {"size": 0, "updateMode": "partial", "buffer": v} for k, v in digits.items() if k in query}
    return {"buffer": buffers, "status": {"session": "c0ffee", "measuring": True, "timedRun": False, "countDown": 0}}


def _post(phone: Phone, settings: VirtualPhoneSettings) -> None:
    poster = _Poster(phone, settings)
    say(f"virtual phone posts to {settings.url}")
    _ride(phone, phone.plan, poster.post_when_due)


class _Poster:
    """Sensor Logger: posts what was measured in the last batch period, some of it twice or too late."""

    def __init__(self, phone: Phone, settings: VirtualPhoneSettings) -> None:
        self._phone = phone
        self._settings = settings
        self._chance = random.Random(settings.seed)
        self._open = build_opener(ProxyHandler({})).open
        self._sent = self._number = 0
        self._due = time.monotonic()
        self._held: list[bytes] = []

    def post_when_due(self) -> None:
        if time.monotonic() < self._due:
            return
        self._due += BATCH_PERIOD
        samples = self._phone.samples(self._sent)
        self._sent += len(samples)
        self._held.append(self._message(samples))
        if self._chance.random() >= self._settings.reorder:
            for body in reversed(self._held):
                self._send(body)
                if self._chance.random() < self._settings.repeat:
                    self._send(body)
            self._held.clear()

    def _message(self, samples: list[PhoneSample]) -> bytes:
        payload = [entry for s in samples for entry in _entries(s)]
        message = {"messageId": self._number, "sessionId": "ride", "deviceId": "virtual-phone", "payload": payload}
        self._number += 1
        return json.dumps(message).encode()

    def _send(self, body: bytes) -> None:
        request = Request(self._settings.url, body, {"Content-Type": "application/json"})
        try:
            self._open(request, timeout=5).close()
        except URLError as error:
            say(f"the bridge answered: {error}")


def _entries(sample: PhoneSample) -> list[dict[str, Any]]:
    x, y, z, w = sample.quaternion
    still = dict.fromkeys("xyz", 0.0)
    values = {
        "gravity": dict(zip("xyz", sample.acceleration, strict=True)),
        "accelerometer": still,
        "magnetometer": dict(zip("xyz", sample.magnetic, strict=True)),
        "orientation": {"qx": x, "qy": y, "qz": z, "qw": w},
    }
    return [{"name": n, "time": round(sample.time * 1e9), "values": v} for n, v in values.items()]
