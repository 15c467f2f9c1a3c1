"""Devices, their calibrations, and which one a recording uses."""

import json

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

ID = sa.String(64)
TIME = sa.DateTime(timezone=True)


def upgrade() -> None:
    devices = op.create_table(
        "devices",
        sa.Column("id", ID, primary_key=True),
        sa.Column("kind", ID, nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("first_seen", TIME, nullable=False),
        sa.Column("last_seen", TIME, nullable=False, index=True),
        sa.Column("last_version", sa.Integer(), nullable=False),
    )
    op.create_table(
        "calibrations",
        sa.Column("device_id", ID, sa.ForeignKey("devices.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("version", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("payload", sa.LargeBinary(), nullable=False),
    )
    op.add_column("recordings", sa.Column("calibration", sa.Integer(), nullable=True))
    op.bulk_insert(devices, _seen_before())


def _seen_before() -> list[dict[str, object]]:
    """Devices of the recordings that are there already."""
    recordings = sa.table("recordings", sa.column("key"), sa.column("hello"), sa.column("created", TIME))
    query = sa.select(recordings.c.hello, recordings.c.created).order_by(recordings.c.key)
    found: dict[str, dict[str, object]] = {}
    for hello, created in op.get_bind().execute(query):
        device = json.loads(bytes(hello)).get("device")
        if device is None:  # not from any device: nothing to list
            continue
        first = found.get(device["id"], {}).get("first_seen", created)
        words = {"id": device["id"], "kind": device["kind"], "name": device.get("name", "")}
        found[device["id"]] = {**words, "first_seen": first, "last_seen": created, "last_version": 0}
    return list(found.values())
