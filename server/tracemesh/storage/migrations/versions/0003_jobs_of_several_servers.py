"""Jobs that several servers share: priority, losses and a beat."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

LONG = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    for name, kind in (("priority", sa.Integer()), ("losses", sa.Integer()), ("beat", LONG)):
        op.add_column("reconstructions", sa.Column(name, kind, nullable=False, server_default="0"))
    op.drop_index("ix_reconstructions_state", "reconstructions")
    op.create_index("ix_reconstructions_queue", "reconstructions", ["state", "priority", "created"])
