"""The socket on which devices send."""

import asyncio
import logging
from functools import partial

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from tracemesh.api.access.roles import Principal
from tracemesh.api.pace import Pace
from tracemesh.api.services import Services, UsePrincipal, UseServices
from tracemesh.api.sockets import first_to_end
from tracemesh.api.websocket import SteadyReading, line
from tracemesh.errors import Refused
from tracemesh.storage.devices import proposal
from tracemesh.storage.exchange import News
from tracemesh.storage.states import RecordingState
from tracemesh.wire.base import PROTOCOL_VERSION
from tracemesh.wire.device import Ack, ErrorMessage, Hello, Recorded, Welcome, from_device

MAX_UNACKNOWLEDGED = 512
"""Messages of one device that wait for the disk before no more are read from it."""
HELLO_TIMEOUT = 10.0
"""s in which a device has to say hello."""
SHORTEST_PAUSE = 0.01
"""s; a shorter one waits until it has grown."""
router = APIRouter()
log = logging.getLogger(__name__)


@router.websocket("/ingest")
async def ingest(socket: WebSocket, services: UseServices, principal: UsePrincipal) -> None:
    """The device protocol: see docs/api.md."""
    await socket.accept()
    device = _Connection(socket, services, principal)
    try:
        await device.serve()
    except Refused as reason:
        await device.refuse(device.failure or reason)
    except (WebSocketDisconnect, TimeoutError):
        pass
    finally:
        await device.leave()


class _Connection:
    """One device's connection; the recorder's view of it is a Sender."""

    def __init__(self, socket: WebSocket, services: Services, principal: Principal) -> None:
        self._socket = socket
        self._services = services
        self._principal = principal
        self._state: RecordingState | None = None
        self._line: SteadyReading | None = None
        self._pace = Pace(services.settings.max_device_rate)
        self._pause = 0.0
        self._acknowledged: int | None = None
        self.failure: Refused | None = None
        """Why the recorder gave this connection up; what is read after that fails for no reason of its own."""
        self._wake = asyncio.Event()

    def acknowledge(self, seq: int) -> None:
        if self._line is None or not self._line.send_now(f'{{"type":"ack","seq":{seq}}}'):
            self._acknowledged = seq
            self._wake.set()

    def fail(self, reason: Refused) -> None:
        self.failure = reason
        self._wake.set()

    async def serve(self) -> None:
        """Until either side has had enough."""
        async with asyncio.timeout(HELLO_TIMEOUT):
            payload = await self._receive()
        hello = _parsed(payload)
        if not isinstance(hello, Hello):
            raise Refused("malformed", f"wanted hello first, got {hello.type}")
        hello = self._in_reach(hello)
        if self._services.recorder.open_count >= self._services.settings.max_devices:
            raise Refused("limit", f"{self._services.settings.max_devices} devices are connected already")
        self._state = await self._services.recorder.open(hello, payload, self)
        self._services.hub.connected(self._state)
        self._services.exchange.post(News("recorded", self._state.session.id, str(self._state.key)))
        known = await asyncio.to_thread(self._known_calibration, self._state.key)
        session, next_seq = self._state.session.id, self._state.next_seq
        await self._send(Welcome(version=PROTOCOL_VERSION, session=session, next_seq=next_seq, calibration=known))
        log.info("recording %s: %s is here, at message %d", hello.recording, hello.device.kind, self._state.next_seq)
        await asyncio.to_thread(self._services.runner.prepare)
        await first_to_end(self._read(self._state), self._answer())

    def _known_calibration(self, key: int) -> str | None:
        with self._services.database.read() as transaction:
            return proposal(transaction, key)

    def _in_reach(self, hello: Hello) -> Hello:
        """A token of one session records into that one, also when the device names none."""
        own = self._principal.session
        if own is None or hello.session == own:
            return hello
        if hello.session is not None:
            raise Refused("forbidden", f"this token records into session {own} only, not into {hello.session}")
        return hello.model_copy(update={"session": own})

    async def refuse(self, reason: Refused) -> None:
        """Say why, and close."""
        self._services.metrics.refusals.labels(reason.code).inc()
        log.warning("a device was refused: %s: %s", reason.code, reason)
        message = ErrorMessage(code=reason.code, message=str(reason), expected_seq=reason.expected_seq)
        try:
            await self._send(message)
            await self._socket.close(1008 if reason.code != "storage" else 1013)
        except (WebSocketDisconnect, RuntimeError):
            pass

    async def leave(self) -> None:
        """Give up the recording."""
        if self._state is not None:
            if await self._services.recorder.leave(self._state, self):
                self._services.hub.disconnected(self._state)
                self._services.exchange.post(News("left", self._state.session.id, str(self._state.key)))
            if self.failure is not None:  # what is drawn may not be what is stored
                self._services.edited(self._state.session.id)

    async def _read(self, state: RecordingState) -> None:
        """Most messages are taken as they come; those that come while the device has to wait are taken here."""
        self._line = line(self._socket.scope)
        self._line.listen(partial(self._take_at_once, state))
        while True:
            payload = await self._receive()
            if self._is_far_ahead(state):
                await self._services.recorder.flush()
            if self._pause > SHORTEST_PAUSE:
                await asyncio.sleep(self._pause)
            self._take(state, payload)

    def _take_at_once(self, state: RecordingState, payload: bytes) -> bool:
        """Whether the next message may be taken at once, too."""
        try:
            self._take(state, payload)
        except Refused as reason:
            self.fail(self.failure or reason)
        return self.failure is None and self._pause <= SHORTEST_PAUSE and not self._is_far_ahead(state)

    def _take(self, state: RecordingState, payload: bytes) -> None:
        message = _parsed(payload)
        if isinstance(message, Hello):
            raise Refused("malformed", "wanted one hello, got a second one")
        self._services.recorder.accept(state, message, payload)
        self._pause = self._pace.take(len(payload))

    @staticmethod
    def _is_far_ahead(state: RecordingState) -> bool:
        return state.next_seq - state.committed > MAX_UNACKNOWLEDGED

    async def _answer(self) -> None:
        while self.failure is None:
            await self._wake.wait()
            self._wake.clear()
            if self._acknowledged is not None:
                seq, self._acknowledged = self._acknowledged, None
                await self._send(Ack(seq=seq))
        raise self.failure

    async def _receive(self) -> bytes:
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1006))
        text: str | None = message.get("text")
        payload: bytes = message["bytes"] if text is None else text.encode()
        return payload

    async def _send(self, message: Welcome | Ack | ErrorMessage) -> None:
        await self._socket.send_text(message.model_dump_json(exclude_none=True))


def _parsed(payload: bytes) -> Hello | Recorded:
    if b"\n" in payload or b"\r" in payload:
        raise Refused("malformed", "wanted one message on one line")
    try:
        return from_device.validate_json(payload)
    except ValidationError as error:
        first = error.errors()[0]
        raise Refused("malformed", f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None
