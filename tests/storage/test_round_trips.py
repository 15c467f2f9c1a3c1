"""What a group commit costs where the database is another machine."""

from collections.abc import Callable

from sqlalchemy import event

from tracemesh.storage.database import Database
from tracemesh.storage.ingest import Group, commit, open_recording
from tracemesh.wire.arrays import ArrayCurve, ArrayReading, SensorArray
from tracemesh.wire.device import CurveStart, Device, Hello, Recorded, Samples

RIBBON = SensorArray(curves=[ArrayCurve(sensors=[0, 1], spacing=[0.1])])
UP = (1.0, 0.0, 0.0, 0.0)


def test_a_round_trip_is_for_all_devices(new_database: Callable[[str], str]) -> None:
    """One device or thirty, as many statements carry their samples to PostgreSQL, and none is sent once per row."""
    database = Database(new_database("postgresql"))
    database.migrate()
    sent: list[bool] = []

    def note(_connection: object, _cursor: object, _text: str, _values: object, _context: object, many: bool) -> None:
        sent.append(many)

    event.listen(database.engine, "before_cursor_execute", note)
    counts = []
    for devices in (1, 30):
        streams = [_stream(f"{devices}-{number}", number % 2 == 1) for number in range(2 * devices)]
        with database.write() as transaction:
            states = [open_recording(transaction, hello, hello.model_dump_json().encode()) for hello, _ in streams]
        for seq in range(2):
            group = Group()
            for state, (_, messages) in zip(states, streams, strict=True):
                state.advance(messages[seq], 2)
                group.add(state, messages[seq], b"{}")
            sent.clear()
            with database.write() as transaction:
                commit(transaction, group)
        assert not any(sent)
        counts.append(len(sent))
    database.close()
    assert counts[0] == counts[1]


def _stream(name: str, is_array: bool) -> tuple[Hello, list[Recorded]]:
    hello = Hello(recording=name, device=Device(id="d", kind="test", array=RIBBON if is_array else None))
    readings: list[Recorded] = [ArrayReading(seq=seq, time=0.0, quaternion=[UP, UP]) for seq in range(2)]
    samples = Samples(seq=1, curve=0, first_sample=0, quaternion=[UP])
    return hello, readings if is_array else [CurveStart(seq=0, curve=0), samples]
