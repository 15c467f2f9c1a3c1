"""Bodies of the REST API about who may do what."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from tracemesh.wire.base import Identifier, Message, Name

Role = Literal["viewer", "device", "owner"]
"""Each may do what those before it may: look; also record; also edit, reconstruct, delete and let others in."""
YEARS = 10 * 366 * 86400
"""s; a token that shall live longer has no end."""


class TokenCreate(Message):
    """POST /tokens."""

    role: Role
    session: Identifier | None = Field(default=None, description="the only session that it opens; none: the server")
    name: Name = Field(default="", description="who or what it is for")
    expires_in: int | None = Field(default=None, ge=1, le=YEARS, description="s from now; none: until it is revoked")


class Token(Message):
    """A token, without its secret."""

    id: Identifier
    role: Role
    session: Identifier | None
    name: str
    created: datetime
    expires: datetime | None
    last_used: datetime | None = Field(description="to about a minute")


class NewToken(Token):
    """A token that was just made; nobody is told its secret again."""

    token: str


class Rights(Message):
    """GET /rights: what whoever asks may do."""

    role: Role
    session: Identifier | None = Field(description="only here; none: everywhere on the server")
    expires: datetime | None
    closed: bool = Field(description="the server demands a token: who is to come in needs one")
