"""Tokens: who may come from elsewhere, and what for. Only digests of them are stored."""

import secrets
from datetime import timedelta
from hashlib import sha256

from sqlalchemy import ColumnElement, delete, or_, select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import NotFound
from tracemesh.storage.models import TokenRow, new_id, now
from tracemesh.storage.sessions import session_row
from tracemesh.wire.access import NewToken, Token, TokenCreate

SECRET_BYTES = 24
"""Random bytes of a token: nobody guesses 192 bits, so a plain digest of them may be stored."""
REMEMBERED = timedelta(days=30)
"""How long a token that has ended is still told from a guess."""
GRAIN = timedelta(minutes=1)
"""How exactly it is known when a token was used last."""


def cookie_of(secret: str) -> str:
    """What a browser keeps instead of the token."""
    return sha256(b"tracemesh cookie " + secret.encode()).hexdigest()


def digest_of(cookie: str) -> str:
    """What is stored of a token, by its cookie."""
    return sha256(cookie.encode()).hexdigest()


def create_token(transaction: Transaction, wanted: TokenCreate) -> NewToken:
    """A new token; its secret is told this once. Raises NotFound for an unknown session."""
    if wanted.session is not None:
        session_row(transaction, wanted.session)
    transaction.execute(delete(TokenRow).where(TokenRow.expires < now() - REMEMBERED))
    secret, made = secrets.token_urlsafe(SECRET_BYTES), now()
    row = TokenRow(
        id=new_id(),
        digest=digest_of(cookie_of(secret)),
        role=wanted.role,
        session_id=wanted.session,
        name=wanted.name,
        created=made,
        expires=None if wanted.expires_in is None else made + timedelta(seconds=wanted.expires_in),
    )
    transaction.add(row)
    transaction.flush()
    return NewToken(**_token(row).model_dump(), token=secret)


def list_tokens(transaction: Transaction, session: str | None = None) -> list[Token]:
    """All tokens, or those of one session, newest first; expired ones are left out."""
    query = select(TokenRow).where(_alive()).order_by(TokenRow.created.desc(), TokenRow.id)
    if session is not None:
        query = query.where(TokenRow.session_id == session)
    return [_token(row) for row in transaction.scalars(query)]


def revoke_token(transaction: Transaction, identifier: str, session: str | None = None) -> None:
    """Let nobody in with this token any more. Raises NotFound, also for one that is not of `session`, if given."""
    row = transaction.scalar(select(TokenRow).where(TokenRow.id == identifier, _alive()))
    if row is None or session not in (None, row.session_id):
        raise NotFound(f"there is no token {identifier}")
    row.expires = now()


def find_token(transaction: Transaction, digest: str) -> Token | None:
    """The token with this digest, whether it has ended or not."""
    row = transaction.scalar(select(TokenRow).where(TokenRow.digest == digest))
    return None if row is None else _token(row)


def touch_token(transaction: Transaction, identifier: str) -> None:
    """It was used just now."""
    row = transaction.get(TokenRow, identifier)
    if row is not None:
        row.last_used = now()


def is_stale(token: Token) -> bool:
    """Whether the time of its last use should be written again."""
    return token.last_used is None or now() - token.last_used > GRAIN


def owner_exists(transaction: Transaction) -> bool:
    """Whether somebody holds a token for the whole server."""
    whole = (TokenRow.role == "owner") & TokenRow.session_id.is_(None)
    return transaction.scalar(select(TokenRow.id).where(whole, _alive()).limit(1)) is not None


def _alive() -> ColumnElement[bool]:
    return or_(TokenRow.expires.is_(None), TokenRow.expires > now())


def _token(row: TokenRow) -> Token:
    return Token(
        id=row.id,
        role=row.role,
        session=row.session_id,
        name=row.name,
        created=row.created,
        expires=row.expires,
        last_used=row.last_used,
    )
