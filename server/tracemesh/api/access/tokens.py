"""Which tokens are good: asked of the database, remembered for a moment."""

import asyncio
import logging
from contextlib import suppress
from time import monotonic

from sqlalchemy.exc import SQLAlchemyError

from tracemesh.api.access.roles import Principal
from tracemesh.storage.database import Database
from tracemesh.storage.models import now
from tracemesh.storage.tokens import find_token, is_stale, touch_token

log = logging.getLogger(__name__)
REMEMBER = 2.0
"""s for which the database is not asked again; a token that another process revoked lives that much longer."""
WATCH = 2.0
"""s between two looks at the token of an open socket."""
MAX_REMEMBERED = 10_000


class Tokens:
    """To be used on one event loop."""

    def __init__(self, database: Database) -> None:
        """Nothing is remembered."""
        self._database = database
        self._known: dict[str, tuple[float, Principal]] = {}
        self._revoked = asyncio.Event()

    async def find(self, digest: str) -> Principal | None:
        """The bearer of the token with this digest, which may have ended; raises SQLAlchemyError."""
        read_at, principal = self._known.get(digest, (0.0, None))
        if principal is not None and monotonic() - read_at < REMEMBER:
            return principal
        principal = await asyncio.to_thread(self._read, digest)
        if principal is not None:
            if len(self._known) >= MAX_REMEMBERED:
                self._known.clear()
            self._known[digest] = monotonic(), principal
        return principal

    def forget(self) -> None:
        """A token was revoked: sockets look at once."""
        self._known.clear()
        self._revoked.set()
        self._revoked = asyncio.Event()

    async def until_ended(self, principal: Principal) -> None:
        """Until the bearer's token is revoked or expires; for ever when there is none."""
        if principal.digest is None:
            await asyncio.Event().wait()
            return
        while await self._is_good(principal.digest):
            left = WATCH if principal.expires is None else (principal.expires - now()).total_seconds()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._revoked.wait(), min(WATCH, max(left, 0.0)))

    async def _is_good(self, digest: str) -> bool:
        try:
            principal = await self.find(digest)
        except SQLAlchemyError:  # the database is away: that is no reason to hang up
            return True
        return principal is not None and not principal.ended

    def _read(self, digest: str) -> Principal | None:
        with self._database.read() as transaction:
            token = find_token(transaction, digest)
        if token is None:
            return None
        principal = Principal(token.role, token.session, token.expires, token.id, digest)
        if is_stale(token) and not principal.ended:
            self._touch(token.id)
        return principal

    def _touch(self, token: str) -> None:
        try:
            with self._database.write() as transaction:
                touch_token(transaction, token)
        except SQLAlchemyError:
            log.warning("could not write down that token %s was used", token)
