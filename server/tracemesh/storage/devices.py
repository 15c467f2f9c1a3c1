"""Devices that were seen here, their calibrations, and which of these a recording uses."""

from contextlib import suppress

from sqlalchemy import func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import Conflict, NotFound
from tracemesh.storage.models import CalibrationRow, DeviceRow, RecordingRow, now
from tracemesh.wire.calibration import Calibration, KnownDevice
from tracemesh.wire.device import Device, Hello


def seen(transaction: Transaction, device: Device) -> None:
    """Note that a device is here now, and store the calibration that it names, if any."""
    row = _device_row(transaction, device.id)
    row.kind, row.name, row.last_seen = device.kind, device.name, now()


def list_devices(transaction: Transaction) -> list[KnownDevice]:
    """All devices, those seen last first."""
    rows = transaction.scalars(select(DeviceRow).order_by(DeviceRow.last_seen.desc(), DeviceRow.id))
    return [_known(transaction, row) for row in rows]


def get_device(transaction: Transaction, identifier: str) -> KnownDevice:
    """One device; raises NotFound."""
    return _known(transaction, _existing(transaction, identifier))


def list_calibrations(transaction: Transaction, device: str) -> list[Calibration]:
    """Calibrations of a device, newest first; raises NotFound."""
    _existing(transaction, device)
    query = select(CalibrationRow).where(CalibrationRow.device_id == device)
    return [_calibration(row) for row in transaction.scalars(query.order_by(CalibrationRow.version.desc()))]


def get_calibration(transaction: Transaction, device: str, version: int) -> Calibration:
    """One calibration; raises NotFound."""
    return _calibration(_calibration_row(transaction, device, version))


def add_calibration(transaction: Transaction, calibration: Calibration, kind: str = "") -> Calibration:
    """The calibration with its version; the same one again has the version that it had. A new device is `kind`."""
    device = _device_row(transaction, calibration.device)
    device.kind, device.last_seen = device.kind or kind, now()
    payload = calibration.model_copy(update={"version": None}).model_dump_json().encode()
    same = (CalibrationRow.device_id == device.id) & (CalibrationRow.payload == payload)
    known = transaction.scalar(select(CalibrationRow).where(same))
    if known is None:
        device.last_version += 1
        known = CalibrationRow(device_id=device.id, version=device.last_version, payload=payload)
        transaction.add(known)
        transaction.flush()
    return _calibration(known)


def delete_calibration(transaction: Transaction, device: str, version: int) -> None:
    """Forget a calibration; raises NotFound, and Conflict while a recording uses it."""
    row = _calibration_row(transaction, device, version)
    users = transaction.scalars(select(RecordingRow).where(RecordingRow.calibration == version))
    using = [r for r in users if Hello.model_validate_json(r.hello).device.id == device]
    if using:
        raise Conflict(
            f"calibration {version} of {device} is used by recording {using[0].id} of session {using[0].session_id}"
            + (f" and {len(using) - 1} more" if len(using) > 1 else "")
        )
    transaction.delete(row)


def choose_calibration(transaction: Transaction, recording: RecordingRow, version: int | None) -> None:
    """Have a recording corrected by a calibration of its device, or by none; raises NotFound."""
    if version is not None:
        _calibration_row(transaction, Hello.model_validate_json(recording.hello).device.id, version)
    recording.calibration = version


def corrected_hello(transaction: Transaction, recording: RecordingRow) -> Hello:
    """A recording's hello with the calibration that was chosen for it instead of the one that it came with."""
    hello = Hello.model_validate_json(recording.hello)
    version = recording.calibration
    chosen = None if version is None else get_calibration(transaction, hello.device.id, version)
    return hello.model_copy(update={"device": hello.device.model_copy(update={"calibration": chosen})})


def proposal(transaction: Transaction, key: int) -> str | None:
    """What people call the newest calibration of a recording's device, if there is one that it does not use."""
    recording = transaction.get(RecordingRow, key)
    if recording is None:  # deleted meanwhile
        return None
    device = Hello.model_validate_json(recording.hello).device.id
    query = select(CalibrationRow).where(CalibrationRow.device_id == device)
    newest = transaction.scalar(query.order_by(CalibrationRow.version.desc()).limit(1))
    return None if newest is None or newest.version == recording.calibration else _calibration(newest).label


def _device_row(transaction: Transaction, identifier: str) -> DeviceRow:
    row = transaction.get(DeviceRow, identifier)
    if row is None:
        row = DeviceRow(id=identifier, kind="", name="", last_version=0, first_seen=now(), last_seen=now())
        with suppress(IntegrityError), transaction.begin_nested():  # another server may see it for the first time, too
            transaction.add(row)
    return transaction.get_one(DeviceRow, identifier)


def _existing(transaction: Transaction, identifier: str) -> DeviceRow:
    row = transaction.get(DeviceRow, identifier)
    if row is None:
        raise NotFound(f"there is no device {identifier}")
    return row


def _calibration_row(transaction: Transaction, device: str, version: int) -> CalibrationRow:
    row = transaction.get(CalibrationRow, (_existing(transaction, device).id, version))
    if row is None:
        raise NotFound(f"there is no calibration {version} of device {device}")
    return row


def _calibration(row: CalibrationRow) -> Calibration:
    return Calibration.model_validate_json(row.payload).model_copy(update={"version": row.version})


def _known(transaction: Transaction, row: DeviceRow) -> KnownDevice:
    stored = select(func.count()).where(CalibrationRow.device_id == row.id)
    return KnownDevice(
        id=row.id,
        kind=row.kind or "unknown",
        name=row.name,
        first_seen=row.first_seen,
        last_seen=row.last_seen,
        calibrations=transaction.scalar(stored) or 0,
    )
