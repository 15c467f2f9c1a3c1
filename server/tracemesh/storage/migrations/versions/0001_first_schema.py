"""Sessions, recordings, messages, curves, marks, reconstructions and artifacts."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

LONG = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
ID = sa.String(64)
TIME = sa.DateTime(timezone=True)


def upgrade() -> None:
    _sessions_and_recordings()
    _curves_and_marks()
    _reconstructions_and_artifacts()


def _sessions_and_recordings() -> None:
    op.create_table(
        "sessions",
        sa.Column("id", ID, primary_key=True),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("created", TIME, nullable=False, index=True),
    )
    op.create_table(
        "recordings",
        sa.Column("key", LONG, primary_key=True, autoincrement=True),
        sa.Column("id", ID, nullable=False, index=True),
        sa.Column("session_id", ID, sa.ForeignKey("sessions.id", ondelete="CASCADE"), nullable=False),
        sa.Column("hello", sa.LargeBinary(), nullable=False),
        sa.Column("made_session", sa.Boolean(), nullable=False),
        sa.Column("next_seq", LONG, nullable=False),
        sa.Column("bytes", LONG, nullable=False),
        sa.Column("created", TIME, nullable=False),
        sa.UniqueConstraint("session_id", "id"),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "messages",
        sa.Column(
            "recording_key",
            LONG,
            sa.ForeignKey("recordings.key", ondelete="CASCADE"),
            primary_key=True,
            autoincrement=False,
        ),
        sa.Column("seq", LONG, primary_key=True, autoincrement=False),
        sa.Column("payload", sa.LargeBinary(), nullable=False),
    )


def _curves_and_marks() -> None:
    op.create_table(
        "curves",
        sa.Column("session_id", ID, sa.ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("index", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("recording_key", LONG, sa.ForeignKey("recordings.key", ondelete="CASCADE"), nullable=False),
        sa.Column("number", LONG, nullable=False),
        sa.Column("boundary", sa.Boolean(), nullable=False),
        sa.Column("closed", sa.Boolean(), nullable=False),
        sa.Column("ended", sa.Boolean(), nullable=False),
        sa.Column("removed", sa.Boolean(), nullable=False),
        sa.Column("samples", LONG, nullable=False),
        sa.Column("length", sa.Double(), nullable=False),
        sa.Column("odometer", sa.Double(), nullable=True),
        sa.UniqueConstraint("recording_key", "number"),
    )
    op.create_table(
        "marks",
        sa.Column("key", LONG, primary_key=True, autoincrement=True),
        sa.Column(
            "recording_key", LONG, sa.ForeignKey("recordings.key", ondelete="CASCADE"), nullable=False, index=True
        ),
        sa.Column("number", LONG, nullable=False),
        sa.Column("sample", LONG, nullable=False),
        sa.Column("node", LONG, nullable=False),
    )


def _reconstructions_and_artifacts() -> None:
    op.create_table(
        "reconstructions",
        sa.Column("id", ID, primary_key=True),
        sa.Column("session_id", ID, sa.ForeignKey("sessions.id", ondelete="CASCADE"), nullable=False, index=True),
        sa.Column("state", sa.String(16), nullable=False, index=True),
        sa.Column("stage", sa.String(200), nullable=False),
        sa.Column("fraction", sa.Double(), nullable=False),
        sa.Column("error", sa.String(), nullable=True),
        sa.Column("parameters", sa.JSON(), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("cancel_requested", sa.Boolean(), nullable=False),
        sa.Column("created", TIME, nullable=False),
        sa.Column("finished", TIME, nullable=True),
    )
    op.create_table(
        "artifacts",
        sa.Column("reconstruction_id", ID, sa.ForeignKey("reconstructions.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("name", sa.String(64), primary_key=True),
        sa.Column("sha256", sa.String(64), nullable=False, index=True),
        sa.Column("size", LONG, nullable=False),
    )
