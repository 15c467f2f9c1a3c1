"""Scans from files of either kind: a rawnet or a recording, told apart by their first character."""

from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import read_recording, scan_from_recordings
from tracemesh.geometry.scan import Scan


def read_scan(text: str, source: str = "") -> Scan:
    """Scan in a rawnet or in a recording; raises InputError with `source` and line."""
    if is_recording(text):
        return scan_from_recordings([read_recording(text.split("\n"), source)])
    return read_rawnet(text, source)


def is_recording(text: str) -> bool:
    """Recordings are JSON objects, one a line; a rawnet begins with a number or a comment."""
    return text.lstrip()[:1] == "{"
