"""Devices that were seen here, and their calibrations; a recording chooses one with PATCH."""

from typing import Annotated

from fastapi import APIRouter, Path, Response

from tracemesh.api.services import Reading, UseServices, Writing
from tracemesh.errors import InputError
from tracemesh.storage import devices
from tracemesh.wire.base import Identifier
from tracemesh.wire.calibration import Calibration, CalibrationCreate, KnownDevice

router = APIRouter(prefix="/devices", tags=["devices"])
Number = Annotated[int, Path(ge=1, le=2**31 - 1)]


@router.get("")
def list_all(transaction: Reading) -> list[KnownDevice]:
    """Those seen last first."""
    return devices.list_devices(transaction)


@router.get("/{device}")
def get(device: Identifier, transaction: Reading) -> KnownDevice:
    """One device."""
    return devices.get_device(transaction, device)


@router.get("/{device}/calibrations")
def list_calibrations(device: Identifier, transaction: Reading) -> list[Calibration]:
    """Newest first."""
    return devices.list_calibrations(transaction, device)


@router.get("/{device}/calibrations/{version}")
def get_calibration(device: Identifier, version: Number, transaction: Reading) -> Calibration:
    """One calibration: what `tracemesh reconstruct --calibration` and the bridge take as a file."""
    return devices.get_calibration(transaction, device, version)


@router.post("/{device}/calibrations", status_code=201)
def add(device: Identifier, wanted: CalibrationCreate, services: UseServices, response: Response) -> Calibration:
    """Store one that is ready, or make one of readings; the same one again keeps its version. Nothing is applied."""
    calibration = wanted.calibration or _made(device, wanted)
    if calibration.device != device:
        raise InputError(f"wanted a calibration of the device {device}, got one of {calibration.device}")
    with services.database.write() as transaction:
        stored = devices.add_calibration(transaction, calibration, wanted.kind)
    response.headers["Location"] = f"/api/v1/devices/{device}/calibrations/{stored.version}"
    return stored


@router.delete("/{device}/calibrations/{version}", status_code=204)
def delete(device: Identifier, version: Number, transaction: Writing) -> None:
    """Forget one; 409 while a recording uses it. Its number is not given again."""
    devices.delete_calibration(transaction, device, version)


def _made(device: str, wanted: CalibrationCreate) -> Calibration:
    from tracemesh.formats.calibrations import calibration_from_readings  # late: it needs the kernel

    assert wanted.readings is not None
    return calibration_from_readings(device, wanted.readings)
