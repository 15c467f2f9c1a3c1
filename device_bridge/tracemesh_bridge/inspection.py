"""Raw bytes beside decoded values, so that the layout of a firmware nobody knows can be found by looking."""

import time
from collections.abc import Iterator

import serial

from tracemesh_bridge.errors import BridgeError, FrameError
from tracemesh_bridge.framing import FrameField, FrameLayout, decode
from tracemesh_bridge.sources.morphorider import drain, find_port, open_port


def inspect(port: str, layout: FrameLayout, timeout: float, count: int, interval: float) -> Iterator[str]:
    """Lines that show `count` frames, and at the end which bytes changed. Raises BridgeError without such a port."""
    path = find_port(port)
    if path is None:
        raise BridgeError(f"no port {port}")
    frames: list[bytes] = []
    yield header(layout)
    try:
        with open_port(path, timeout) as line:
            for _ in range(count):
                line.write(bytes([layout.request]))
                data = line.read(layout.length) + drain(line)
                frames.append(data)
                yield from describe(layout, data)
                time.sleep(interval)
    except serial.SerialException as error:
        raise BridgeError(f"{path}: {error}") from error
    yield changes(frames, layout.length)


def header(layout: FrameLayout) -> str:
    """Names of the fields, over their columns."""
    return "".join(f"{_short(f):>{_width(f)}}" for f in _in_order(layout))


def describe(layout: FrameLayout, data: bytes) -> Iterator[str]:
    """A frame's bytes under their fields, and below them the values; or why it is no frame."""
    if len(data) != layout.length:
        yield f"   {data.hex(' ') or 'nothing'}   ({len(data)} bytes; wanted {layout.length})"
        return
    fields = _in_order(layout)
    yield "".join(f"{data[f.offset : f.end].hex(' '):>{_width(f)}}" for f in fields)
    yield "".join(f"{_value(f, data):>{_width(f)}}" for f in fields)
    try:
        decode(layout, data)
    except FrameError as error:
        yield f"   implausible: {error}"


def changes(frames: list[bytes], length: int) -> str:
    """Under each byte's number: how many values it took, a dot for one that never changed."""
    whole = [f for f in frames if len(f) == length]
    if not whole:
        return f"no frame of {length} bytes came: is it the right port, and is the device switched on?"
    values = [len({f[i] for f in whole}) for i in range(length)]
    numbers = "".join(f"{i:>4}" for i in range(length))
    return f"byte    {numbers}\nvalues  {''.join(f'{v if v > 1 else chr(46):>4}' for v in values)}"


def _in_order(layout: FrameLayout) -> list[FrameField]:
    return sorted(layout.fields, key=lambda f: f.offset)


def _short(field: FrameField) -> str:
    return field.name.replace("acceleration_", "acc ").replace("magnetic_", "mag ")


def _width(field: FrameField) -> int:
    return max(len(_short(field)), 3 * field.size, 8) + 2


def _value(field: FrameField, data: bytes) -> str:
    integer = field.integer(data)
    return str(integer) if field.scale == 1 else f"{integer * field.scale:+.4f}"
