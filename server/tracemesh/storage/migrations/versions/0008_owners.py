"""Which of several servers a recording's device sends to."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("recordings", sa.Column("owner", sa.String(16), nullable=False, server_default=""))
