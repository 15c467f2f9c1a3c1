"""The load of the ingest benchmark is real: every message is sent, acknowledged and timed, and watched."""

from benchmarks.data import Data
from benchmarks.ingest import COLUMNS, ingest
from benchmarks.load import BATCH, RATE


def test_every_message_of_every_device_is_acknowledged() -> None:
    table = ingest(Data(None), devices=(3,), seconds=1.0, further=0)
    row = dict(zip((c.title for c in COLUMNS), table.rows[0], strict=True))
    assert (row["devices"], row["lost"]) == (3, 0)
    assert 0 < row["ack p50, ms"] <= row["ack p95, ms"] <= row["ack p99, ms"] <= row["ack max, ms"]
    assert 0 < row["live view p50, ms"] <= row["live view p95, ms"]
    assert row["messages/s"] <= 1.5 * 3 * RATE / BATCH
    assert table.notes[-1].startswith("Limit found: ")
