"""The browser and the bridge read the same frames: one file of examples, checked on both sides."""

import json
from pathlib import Path

from tracemesh_bridge.errors import FrameError
from tracemesh_bridge.framing import Frame, FrameLayout, decode

VECTORS = Path(__file__).resolve().parents[2] / "web/src/protocol/framing.vectors.json"


def test_the_bridge_reads_the_shared_frames_as_they_are_written_down() -> None:
    vectors = json.loads(VECTORS.read_text())
    assert {vector["frame"] is None for vector in vectors} == {True, False}
    for vector in vectors:
        assert _read(bytes.fromhex(vector["hex"])) == vector["frame"], vector["hex"]


def _read(data: bytes) -> dict[str, list[float]] | None:
    try:
        frame: Frame = decode(FrameLayout(), data)
    except FrameError:
        return None
    return {"ticks": list(frame.ticks), "acceleration": list(frame.acceleration), "magnetic": list(frame.magnetic)}
