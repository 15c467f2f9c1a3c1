"""What a server that demands a token says to the person who starts it."""

import socket

from tracemesh.settings import Settings
from tracemesh.storage.database import Database
from tracemesh.storage.tokens import create_token, owner_exists
from tracemesh.wire.access import TokenCreate


def greet(settings: Settings, port: int) -> None:
    """Print the owner's link when nobody owns the server yet; it is the only time that its token is told."""
    address = f"http://{_named(settings.host)}:{port}/"
    if settings.token is not None:
        print(f"Open  {address}  with the token in TRACEMESH_TOKEN", flush=True)
        return
    database = Database(settings.resolved_database_url)
    with database.write() as transaction:
        wanted = TokenCreate(role="owner", name="first start")
        secret = None if owner_exists(transaction) else create_token(transaction, wanted).token
    database.close()
    if secret is None:
        print(f"Open  {address}  (a new owner's token: tracemesh token create --role owner)", flush=True)
    else:
        print(
            f"Open  {address}?token={secret}\nThis link makes its bearer the owner; it is not shown again.", flush=True
        )


def _named(host: str) -> str:
    """The host as others name it in an address."""
    if host in ("0.0.0.0", "::"):
        host = main_address()
    return f"[{host}]" if ":" in host else host


def main_address() -> str:
    """This machine's address on the network that it reaches others by; loopback when there is none. Sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # an address for documentation: only the way to it is looked up
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"
