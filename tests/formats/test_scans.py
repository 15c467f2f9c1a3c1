"""Either kind of file is recognised by its first character."""

from tracemesh.formats.rawnet import write_rawnet
from tracemesh.formats.recordings import Recording, recording_from_scan, write_recording
from tracemesh.formats.scans import is_recording, read_scan
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan

SCAN = exact_scan(leaf(), 0.05)


def lengths(scan: Scan | Recording) -> list[int]:
    assert isinstance(scan, Scan)
    return [len(c.distance) for c in scan.curves]


def test_a_rawnet_and_a_recording_hold_the_same_scan() -> None:
    rawnet, recording = write_rawnet(SCAN), write_recording(recording_from_scan(SCAN, "leaf"))
    assert (is_recording(rawnet), is_recording(recording)) == (False, True)
    assert lengths(read_scan(rawnet)) == lengths(read_scan(recording)) == lengths(SCAN)


def test_windows_line_ends_and_odd_characters_in_a_name_do_no_harm() -> None:
    recording = recording_from_scan(SCAN, "leaf")
    device = recording.hello.device.model_copy(update={"name": "two\u2028lines\x85"})
    named = Recording(recording.hello.model_copy(update={"device": device}), recording.messages)
    text = write_recording(named).replace("\n", "\r\n")
    assert lengths(read_scan("\n" + text)) == lengths(SCAN)
    assert lengths(read_scan(write_rawnet(SCAN).replace("\n", "\r\n"))) == lengths(SCAN)
