"""Batches: many scans sent at once."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "batches",
        sa.Column("id", sa.String(64), primary_key=True),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("size", sa.Integer(), nullable=False),
        sa.Column("created", sa.DateTime(timezone=True), nullable=False, index=True),
    )
    # without a foreign key: SQLite could only get one by making the table anew, which deletes what refers to it
    op.add_column("reconstructions", sa.Column("batch_id", sa.String(64), nullable=True))
    op.create_index("ix_reconstructions_batch_id", "reconstructions", ["batch_id"])
