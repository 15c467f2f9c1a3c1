"""What a server that demands a token says to the person who starts it."""

from typing import TYPE_CHECKING

import segno

from tracemesh.api.lan.addresses import main_address
from tracemesh.settings import Settings
from tracemesh.storage.database import Database
from tracemesh.storage.tokens import create_token, owner_exists
from tracemesh.wire.access import TokenCreate

if TYPE_CHECKING:
    from tracemesh.api.lan.authority import Authority


def greet(settings: Settings, port: int) -> None:
    """Print the owner's link when nobody owns the server yet; it is the only time that its token is told."""
    address = f"{'https' if settings.lan else 'http'}://{_named(settings.listen_host)}:{port}/"
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


def greet_phones(authority: "Authority", plain_port: int | None) -> None:
    """Print where a phone gets the certificate, which holds no secret, and its fingerprint to compare."""
    print(f"Certificate to trust  {authority.file}\nits SHA-256  {authority.fingerprint}", flush=True)
    if plain_port is not None:
        address = f"http://{main_address()}:{plain_port}/"
        print(f"Phones first open  {address}  and get the certificate there:", flush=True)
        segno.make(address).terminal(compact=True)


def _named(host: str) -> str:
    """The host as others name it in an address."""
    if host in ("0.0.0.0", "::"):
        host = main_address()
    return f"[{host}]" if ":" in host else host
