"""The socket on which browsers watch a session."""

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from starlette.concurrency import run_in_threadpool

from tracemesh.api.live.client import Client
from tracemesh.api.live.room import Room
from tracemesh.api.services import Services, UseServices
from tracemesh.api.sockets import first_to_end
from tracemesh.errors import NotFound
from tracemesh.storage.sessions import get_session
from tracemesh.wire.base import Identifier

router = APIRouter()


@router.websocket("/sessions/{session}/live")
async def live(socket: WebSocket, session: Identifier, services: UseServices) -> None:
    """`live.snapshot` first, then what changes; see docs/api.md."""
    await socket.accept()
    try:
        await run_in_threadpool(_check, services, session)
    except NotFound as error:
        await socket.close(4404, str(error))
        return
    room, client = services.hub.join(session)
    try:
        await first_to_end(_send(socket, room, client), _until_gone(socket))
    except WebSocketDisconnect:
        pass
    finally:
        await services.hub.leave(room, client)


def _check(services: Services, session: str) -> None:
    with services.database.read() as transaction:
        get_session(transaction, session)


async def _send(socket: WebSocket, room: Room, client: Client) -> None:
    while not client.ended:
        await client.wait()
        if client.behind:
            text = await room.snapshot()
            client.behind = False
            await socket.send_text(text)
        while (change := client.pop()) is not None:
            await socket.send_text(change)
    await socket.close(1012, "connect again")


async def _until_gone(socket: WebSocket) -> None:
    """Browsers have nothing to say here."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass
