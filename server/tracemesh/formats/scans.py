"""What was measured, from files of either kind: a rawnet or a recording, told apart by their first character."""

from tracemesh.errors import InputError
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import Recording, read_recording, scan_from_recordings
from tracemesh.formats.references import with_calibration, with_reference
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.sensing.orientation import ReferenceField
from tracemesh.wire.calibration import Calibration


def read_scan(
    text: str, source: str = "", field: ReferenceField | None = None, calibration: Calibration | None = None
) -> Scan | Recording:
    """Scan in a rawnet or in a recording, whose vectors are compared with `field` instead of what its hello names.

    calibration: of the device that made the recording, instead of the one that its hello names, if any. The
    recording of a fixed array comes back as it is: each of its readings is a network. Raises InputError with `source`
    and line, and where a field or a calibration is given that changes nothing.
    """
    if is_recording(text):
        recording = with_calibration(read_recording(text.split("\n"), source), calibration)
        recording = with_reference(recording, field) if field else recording
        if recording.hello.device.array:
            return _of_array(recording, source)
        scan = scan_from_recordings([recording])
        if calibration and not any(curve.calibration for curve in scan.curves):
            raise InputError(f"{source}: its device sent orientations and lengths: {calibration.label} changes nothing")
        return scan
    if field or calibration:
        what = "a magnetic field can explain" if field else "a calibration can correct"
        raise InputError(f"{source}: wanted a recording, whose vectors {what}, got a rawnet")
    return read_rawnet(text, source)


def _of_array(recording: Recording, source: str) -> Recording:
    if calibration := recording.hello.device.calibration:
        label = calibration.label
        raise InputError(f"{source}: {label} is of one sensor, and this is the recording of an array of them")
    return recording


def is_recording(text: str) -> bool:
    """Recordings are JSON objects, one a line; a rawnet begins with a number or a comment."""
    return text.lstrip()[:1] == "{"
