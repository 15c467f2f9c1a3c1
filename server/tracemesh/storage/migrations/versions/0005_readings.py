"""Readings of fixed arrays."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

LONG = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
ID = sa.String(64)


def upgrade() -> None:
    op.create_table(
        "readings",
        sa.Column("session_id", ID, sa.ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("index", LONG, primary_key=True, autoincrement=False),
        sa.Column(
            "recording_key", LONG, sa.ForeignKey("recordings.key", ondelete="CASCADE"), nullable=False, index=True
        ),
        sa.Column("seq", LONG, nullable=False),
        sa.Column("time", sa.Double(), nullable=False),
    )
