"""What devices and apps send: any bytes, line by line, are left out and counted, or become readings to be recorded.

A reading that a bridge could not put into a message, or a count that it could not show, would end its ride.
"""

from collections.abc import Iterable

from tracemesh.errors import TracemeshError
from tracemesh.formats.recordings import read_recording
from tracemesh.wire.arrays import ArrayReading, SensorArray
from tracemesh.wire.device import Device, Samples
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.health import Host
from tracemesh_bridge.mrider import read_mrider
from tracemesh_bridge.source import Link, Reading
from tracemesh_bridge.sources.phyphox import NEVER, Phyphox, find_inputs, parse, parse_status
from tracemesh_bridge.sources.program import Program
from tracemesh_bridge.sources.sensorlogger import Translator
from tracemesh_bridge.sources.sensorlogger_batches import Reorder, parse_batch
from tracemesh_bridge.sources.sensorserver import SensorServer, SensorServerSettings

COLUMNS = ("time", "received", "acceleration", "magnetic", "rotation_rate", "quaternion")
PHONE = Device(id="phone", kind="phone")
PAIR = Device(
    id="pair",
    kind="array",
    array=SensorArray.model_validate({"curves": [{"sensors": [0, 1], "spacing": [0.1]}]}),
)


def sensorserver(data: bytes) -> None:
    """Messages of the app, one a line."""
    host = _host()
    source = SensorServer(SensorServerSettings("phone:8080"), PHONE, host)
    _record(host, (source.take(line) for line in data.split(b"\n")))


def sensorlogger(data: bytes) -> None:
    """Bodies of the app's posts, one a line."""
    host = _host()
    order, translator = Reorder(host.health), Translator(host)
    for line in data.split(b"\n"):
        try:
            batch = parse_batch(line, host.clock.now())
        except BridgeError:
            continue
        for ready in order.add(batch):
            _record(host, translator.readings(ready))


def phyphox(data: bytes) -> None:
    """The app's description of its experiment, then its answers, one a line."""
    host = _host()
    source = Phyphox("phone:8080", PHONE, host)
    config, *answers = data.split(b"\n")
    try:
        since = dict.fromkeys(find_inputs(parse(config)), NEVER)
        for line in answers:
            answer = parse(line)
            parse_status(answer)
            _record(host, source.read(answer, since, host.clock.now()))
    except BridgeError:
        return


def array(data: bytes) -> None:
    """Lines that the program of an array of two sensors prints."""
    host = _host()
    source = Program(["array"], PAIR, host)
    for line in data.split(b"\n"):
        if (reading := source.take(line)) is not None:
            ArrayReading.model_validate_json(reading.model_dump_json(exclude_none=True))
    host.health.describe(host.clock.now())


def mrider(data: bytes) -> None:
    """A file of the thesis's author's app, either way; what is made of it is a recording."""
    for transposed in (True, False):
        try:
            lines = read_mrider(data.decode("utf-8", "replace").split("\n"), "fuzz", transposed)
        except TracemeshError:
            continue
        read_recording(lines)


def _host() -> Host:
    return Host(Link("phone", lambda words: None))


def _record(host: Host, readings: Iterable[Reading | None]) -> None:
    for reading in readings:
        if reading is not None:
            known = {name: [value] for name in COLUMNS if (value := getattr(reading, name)) is not None}
            samples = Samples.model_validate({"seq": 0, "curve": 0, "first_sample": 0, **known})
            assert Samples.model_validate_json(samples.model_dump_json(exclude_none=True)) == samples
    host.health.describe(host.clock.now())
