"""Scans from files of either kind: a rawnet or a recording, told apart by their first character."""

from tracemesh.errors import InputError
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import read_recording, scan_from_recordings
from tracemesh.formats.references import with_reference
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.sensing.orientation import ReferenceField


def read_scan(text: str, source: str = "", field: ReferenceField | None = None) -> Scan:
    """Scan in a rawnet or in a recording, whose vectors are compared with `field` instead of what its hello names.

    Raises InputError with `source` and line, and where a field is given that changes nothing.
    """
    if is_recording(text):
        recording = read_recording(text.split("\n"), source)
        return scan_from_recordings([with_reference(recording, field) if field else recording])
    if field:
        raise InputError(f"{source}: wanted a recording, whose vectors a magnetic field can explain, got a rawnet")
    return read_rawnet(text, source)


def is_recording(text: str) -> bool:
    """Recordings are JSON objects, one a line; a rawnet begins with a number or a comment."""
    return text.lstrip()[:1] == "{"
