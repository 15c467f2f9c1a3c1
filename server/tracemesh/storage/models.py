"""Tables. Raw messages are append-only, exactly as sent; curves and marks are derived from them and may be edited."""

import secrets
from datetime import UTC, datetime
from hashlib import sha256
from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    DateTime,
    Dialect,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    String,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeDecorator

from tracemesh.wire.access import Role

Long = BigInteger().with_variant(Integer(), "sqlite")
"""64 bits on every database; only INTEGER counts by itself on SQLite, and holds 64 bits there."""
INTERACTIVE, BATCH = 0, 1
"""Priorities of jobs: somebody waits for the first kind."""


class UtcTime(TypeDecorator[datetime]):
    """A point in time, always UTC; SQLite forgets the zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Give the zone back."""
        return value if value is None or value.tzinfo else value.replace(tzinfo=UTC)


def now() -> datetime:
    """The present time, UTC."""
    return datetime.now(UTC)


def new_id() -> str:
    """An identifier that nobody has chosen yet; 64 random bits."""
    return secrets.token_hex(8)


def derived_id(key: str, *scope: str) -> str:
    """The identifier of what a request with this idempotency key makes: the same again for the same request."""
    return sha256("\n".join([*scope, key]).encode()).hexdigest()[:32]


class Base(DeclarativeBase):
    """Base of all tables."""


class SessionRow(Base):
    """One object being scanned."""

    __tablename__ = "sessions"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str] = mapped_column(String(200), default="")
    created: Mapped[datetime] = mapped_column(UtcTime, default=now, index=True)


class TokenRow(Base):
    """Lets its bearer in: to one session, or to the whole server. Of the secret only a digest is kept."""

    __tablename__ = "tokens"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    digest: Mapped[str] = mapped_column(String(64), unique=True)
    role: Mapped[Role] = mapped_column(String(16))
    session_id: Mapped[str | None] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), index=True)
    name: Mapped[str] = mapped_column(String(200), default="")
    created: Mapped[datetime] = mapped_column(UtcTime, default=now)
    expires: Mapped[datetime | None] = mapped_column(UtcTime)
    last_used: Mapped[datetime | None] = mapped_column(UtcTime)


class RecordingRow(Base):
    """What one device sent into one session; `next_seq` messages of it are committed.

    `calibration` is the version of its device's calibration that corrects it, if one was chosen.

    `owner` is the server that took it last: no other one may write into it.

    A key is never used twice: whoever holds the key of a deleted recording must not write into another one.
    """

    __tablename__ = "recordings"
    __table_args__ = (UniqueConstraint("session_id", "id"), {"sqlite_autoincrement": True})

    key: Mapped[int] = mapped_column(Long, primary_key=True, autoincrement=True)
    id: Mapped[str] = mapped_column(String(64), index=True)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"))
    hello: Mapped[bytes] = mapped_column(LargeBinary)
    made_session: Mapped[bool] = mapped_column(default=False)
    owner: Mapped[str] = mapped_column(String(16), default="", server_default="")
    next_seq: Mapped[int] = mapped_column(Long, default=0)
    bytes: Mapped[int] = mapped_column(Long, default=0)
    created: Mapped[datetime] = mapped_column(UtcTime, default=now)
    calibration: Mapped[int | None]


class DeviceRow(Base):
    """A device that sent something or was calibrated; `last_version` is the highest number of its calibrations."""

    __tablename__ = "devices"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    kind: Mapped[str] = mapped_column(String(64))
    name: Mapped[str] = mapped_column(String(200))
    first_seen: Mapped[datetime] = mapped_column(UtcTime)
    last_seen: Mapped[datetime] = mapped_column(UtcTime, index=True)
    last_version: Mapped[int]


class CalibrationRow(Base):
    """A calibration of a device as JSON; versions are counted from 1, none is used twice."""

    __tablename__ = "calibrations"

    device_id: Mapped[str] = mapped_column(ForeignKey("devices.id", ondelete="CASCADE"), primary_key=True)
    version: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    payload: Mapped[bytes] = mapped_column(LargeBinary)


class MessageRow(Base):
    """One message of a device, byte for byte."""

    __tablename__ = "messages"

    recording_key: Mapped[int] = mapped_column(ForeignKey("recordings.key", ondelete="CASCADE"), primary_key=True)
    seq: Mapped[int] = mapped_column(Long, primary_key=True)
    payload: Mapped[bytes] = mapped_column(LargeBinary)


class CurveRow(Base):
    """One curve of a session; `number` is its number within its recording, `odometer` (m) its last
    reading, `lengths` what was measured between samples.
    """

    __tablename__ = "curves"
    __table_args__ = (UniqueConstraint("recording_key", "number"),)

    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    index: Mapped[int] = mapped_column(primary_key=True)
    recording_key: Mapped[int] = mapped_column(ForeignKey("recordings.key", ondelete="CASCADE"))
    number: Mapped[int] = mapped_column(Long)
    boundary: Mapped[bool]
    closed: Mapped[bool] = mapped_column(default=False)
    ended: Mapped[bool] = mapped_column(default=False)
    removed: Mapped[bool] = mapped_column(default=False)
    samples: Mapped[int] = mapped_column(Long, default=0)
    length: Mapped[float] = mapped_column(default=0.0)
    odometer: Mapped[float | None]
    lengths: Mapped[list[dict[str, Any]]] = mapped_column(JSON, default=list, server_default="[]")


class MarkRow(Base):
    """A node marked on a curve."""

    __tablename__ = "marks"

    key: Mapped[int] = mapped_column(Long, primary_key=True, autoincrement=True)
    recording_key: Mapped[int] = mapped_column(ForeignKey("recordings.key", ondelete="CASCADE"), index=True)
    number: Mapped[int] = mapped_column(Long)
    sample: Mapped[int] = mapped_column(Long)
    node: Mapped[int] = mapped_column(Long)


class ReadingRow(Base):
    """One reading of a fixed array: message `seq` of its recording; `index` counts all readings of the session."""

    __tablename__ = "readings"

    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    index: Mapped[int] = mapped_column(Long, primary_key=True)
    recording_key: Mapped[int] = mapped_column(ForeignKey("recordings.key", ondelete="CASCADE"), index=True)
    seq: Mapped[int] = mapped_column(Long)
    time: Mapped[float]


class BatchRow(Base):
    """Many scans that were sent at once."""

    __tablename__ = "batches"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str] = mapped_column(String(200), default="")
    size: Mapped[int]
    created: Mapped[datetime] = mapped_column(UtcTime, default=now, index=True)


class ReconstructionRow(Base):
    """A reconstruction of a session: this row is the job.

    `attempt` guards against results of a lost attempt, `losses` counts those; `beat` goes up as long as somebody
    watches over the attempt. The least `priority` is first.
    """

    __tablename__ = "reconstructions"
    __table_args__ = (Index("ix_reconstructions_queue", "state", "priority", "created"),)

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), index=True)
    batch_id: Mapped[str | None] = mapped_column(String(64), index=True)
    state: Mapped[str] = mapped_column(String(16), default="queued")
    stage: Mapped[str] = mapped_column(String(200), default="")
    fraction: Mapped[float] = mapped_column(default=0.0)
    error: Mapped[str | None]
    parameters: Mapped[dict[str, Any]] = mapped_column(JSON)
    priority: Mapped[int] = mapped_column(default=INTERACTIVE, server_default="0")
    attempt: Mapped[int] = mapped_column(default=0)
    losses: Mapped[int] = mapped_column(default=0, server_default="0")
    beat: Mapped[int] = mapped_column(Long, default=0, server_default="0")
    cancel_requested: Mapped[bool] = mapped_column(default=False)
    created: Mapped[datetime] = mapped_column(UtcTime, default=now)
    finished: Mapped[datetime | None] = mapped_column(UtcTime)


class ArtifactRow(Base):
    """A file that a reconstruction left; its content is kept under its SHA-256."""

    __tablename__ = "artifacts"

    reconstruction_id: Mapped[str] = mapped_column(
        ForeignKey("reconstructions.id", ondelete="CASCADE"), primary_key=True
    )
    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    size: Mapped[int] = mapped_column(Long)
