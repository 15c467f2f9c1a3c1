"""A session in one file: recordings as sent, curves as edited, reconstructions with their files; each with its SHA-256.

A zip of `session.json` (the manifest), `recordings/NAME.ndjson` and `artifacts/DIGEST`.
"""

import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from datetime import datetime
from hashlib import sha256
from typing import IO, Literal

from pydantic import Field, ValidationError
from sqlalchemy import select, update
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import InputError
from tracemesh.storage.artifacts import ArtifactStore
from tracemesh.storage.curves import marks_of, replace_lengths, replace_marks
from tracemesh.storage.devices import add_calibration, choose_calibration, corrected_hello
from tracemesh.storage.models import ArtifactRow, CurveRow, ReconstructionRow, RecordingRow, new_id
from tracemesh.storage.recordings import recording_messages
from tracemesh.storage.sessions import session_row
from tracemesh.wire.base import Count, Identifier, Message, Name
from tracemesh.wire.calibration import Calibration
from tracemesh.wire.resources import Mark, MeasuredLength, ReconstructionParameters

MANIFEST = "session.json"
RECORDINGS = "recordings/"
"""What the names of recordings in an archive begin with."""
DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    KeyError,
    NotImplementedError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
)
"""What zipfile raises for files that are none, or are damaged."""


class ArchivedCurve(Message):
    """A curve as edited; `number` is its number within its recording."""

    recording: Identifier
    number: Count
    index: Count
    boundary: bool
    closed: bool
    removed: bool
    marks: list[Mark]
    lengths: list[MeasuredLength] = Field(default=[])


class ArchivedReconstruction(Message):
    """A reconstruction that is done; `artifacts` maps its files' names to the digests of their contents."""

    parameters: ReconstructionParameters
    created: datetime
    finished: datetime | None
    artifacts: dict[Literal["network.json", "mesh.glb", "report.json"], str]


class Manifest(Message):
    """What an archive holds."""

    format: Literal["tracemesh-session"] = "tracemesh-session"
    version: Literal[1] = 1
    name: Name
    curves: list[ArchivedCurve]
    reconstructions: list[ArchivedReconstruction]
    calibrations: dict[Identifier, Calibration] = Field(
        default={}, description="recording -> the calibration that was chosen for it"
    )
    files: dict[str, str] = Field(description="path -> SHA-256 of the content")


def write_archive(transaction: Transaction, store: ArtifactStore, session: str, file: IO[bytes]) -> None:
    """Write everything of a session; raises NotFound."""
    name = session_row(transaction, session).name
    curves, reconstructions = _archived_curves(transaction, session), _archived_reconstructions(transaction, session)
    digests = sorted({digest for r in reconstructions for digest in r.artifacts.values()})
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        files = {path: _add(archive, path, content) for path, content in _recordings(transaction, session)}
        files |= {f"artifacts/{d}": _add(archive, f"artifacts/{d}", store.path(d).read_bytes()) for d in digests}
        chosen = _chosen_calibrations(transaction, session)
        manifest = Manifest(name=name, curves=curves, reconstructions=reconstructions, calibrations=chosen, files=files)
        archive.writestr(MANIFEST, manifest.model_dump_json(indent=1))


def read_archive(file: IO[bytes], max_bytes: int) -> tuple[Manifest, dict[str, bytes]]:
    """Manifest and contents; raises InputError for anything that is not a whole, undamaged archive."""
    try:
        with zipfile.ZipFile(file) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > max_bytes:
                raise InputError(f"wanted an archive of at most {max_bytes} bytes when unpacked")
            manifest = Manifest.model_validate_json(archive.read(MANIFEST))
            contents = {name: archive.read(name) for name in manifest.files}
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(f"{MANIFEST}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    except DAMAGED as error:
        raise InputError(f"wanted an archive of a session: {error}") from None
    for name, content in contents.items():
        if sha256(content).hexdigest() != manifest.files[name]:
            raise InputError(f"{name}: its content is not what was archived")
    return manifest, contents


def restore(
    transaction: Transaction, store: ArtifactStore, session: str, manifest: Manifest, contents: Mapping[str, bytes]
) -> None:
    """Edit the curves and add the reconstructions of a session that has the archive's recordings already.

    Raises InputError when the manifest does not fit the recordings.
    """
    rows = _rows_by_origin(transaction, session)
    if {(c.recording, c.number) for c in manifest.curves} != rows.keys():
        raise InputError(f"{MANIFEST}: its curves are not those of its recordings")
    if sorted(c.index for c in manifest.curves) != list(range(len(rows))):
        raise InputError(f"{MANIFEST}: its curves are not numbered 0, 1, 2, ...")
    _choose_calibrations(transaction, session, manifest.calibrations)
    for curve in manifest.curves:
        row = rows[curve.recording, curve.number]
        row.boundary, row.closed, row.removed = curve.boundary, curve.closed, curve.removed
        replace_marks(transaction, row, curve.marks)
        replace_lengths(row, curve.lengths)
    transaction.flush()
    _renumber(transaction, session, {rows[c.recording, c.number].index: c.index for c in manifest.curves})
    for reconstruction in manifest.reconstructions:
        _add_reconstruction(transaction, store, session, reconstruction, contents)


def _renumber(transaction: Transaction, session: str, numbers: Mapping[int, int]) -> None:
    """Old index -> new index; by way of negative ones, so that no two curves have the same one in between."""
    in_session = CurveRow.session_id == session
    connection = transaction.connection()
    for old, new in numbers.items():
        connection.execute(update(CurveRow).where(in_session, CurveRow.index == old).values(index=-1 - new))
    connection.execute(update(CurveRow).where(in_session).values(index=-1 - CurveRow.index))
    transaction.expire_all()


def _add_reconstruction(
    transaction: Transaction,
    store: ArtifactStore,
    session: str,
    archived: ArchivedReconstruction,
    contents: Mapping[str, bytes],
) -> None:
    row = ReconstructionRow(
        id=new_id(),
        session_id=session,
        state="done",
        fraction=1.0,
        parameters=archived.parameters.model_dump(),
        created=archived.created,
        finished=archived.finished,
    )
    transaction.add(row)
    transaction.flush()
    for name, digest in archived.artifacts.items():
        content = contents.get(f"artifacts/{digest}")
        if content is None:
            raise InputError(f"{MANIFEST}: {name} of a reconstruction is missing")
        transaction.add(ArtifactRow(reconstruction_id=row.id, name=name, sha256=store.put(content), size=len(content)))


def _recordings(transaction: Transaction, session: str) -> Iterator[tuple[str, bytes]]:
    query = select(RecordingRow).where(RecordingRow.session_id == session).order_by(RecordingRow.key)
    for row in transaction.scalars(query):
        lines = [row.hello, *recording_messages(transaction, row.key)]
        yield f"{RECORDINGS}{row.id}.ndjson", b"".join(line + b"\n" for line in lines)


def _chosen_calibrations(transaction: Transaction, session: str) -> dict[str, Calibration]:
    rows = transaction.scalars(select(RecordingRow).where(RecordingRow.session_id == session))
    devices = {row.id: corrected_hello(transaction, row).device for row in rows}
    return {name: device.calibration for name, device in devices.items() if device.calibration is not None}


def _choose_calibrations(transaction: Transaction, session: str, chosen: Mapping[str, Calibration]) -> None:
    """What is archived is stored here, too, under whatever number is next."""
    for row in transaction.scalars(select(RecordingRow).where(RecordingRow.session_id == session)):
        calibration = chosen.get(row.id)
        stored = add_calibration(transaction, calibration) if calibration else None
        choose_calibration(transaction, row, stored.version if stored else None)


def _rows_by_origin(transaction: Transaction, session: str) -> dict[tuple[str, int], CurveRow]:
    query = select(CurveRow, RecordingRow.id).join(RecordingRow, RecordingRow.key == CurveRow.recording_key)
    found = transaction.execute(query.where(CurveRow.session_id == session).order_by(CurveRow.index))
    return {(recording, curve.number): curve for curve, recording in found}


def _archived_curves(transaction: Transaction, session: str) -> list[ArchivedCurve]:
    return [
        ArchivedCurve(
            recording=recording,
            number=number,
            index=row.index,
            boundary=row.boundary,
            closed=row.closed,
            removed=row.removed,
            marks=marks_of(transaction, row),
            lengths=[MeasuredLength.model_validate(entry) for entry in row.lengths],
        )
        for (recording, number), row in _rows_by_origin(transaction, session).items()
    ]


def _archived_reconstructions(transaction: Transaction, session: str) -> list[ArchivedReconstruction]:
    done = (ReconstructionRow.session_id == session) & (ReconstructionRow.state == "done")
    rows = transaction.scalars(select(ReconstructionRow).where(done).order_by(ReconstructionRow.created))
    return [
        ArchivedReconstruction(
            parameters=ReconstructionParameters.model_validate(row.parameters),
            created=row.created,
            finished=row.finished,
            artifacts={
                artifact.name: artifact.sha256
                for artifact in transaction.scalars(select(ArtifactRow).where(ArtifactRow.reconstruction_id == row.id))
            },
        )
        for row in rows
    ]


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> str:
    archive.writestr(name, content)
    return sha256(content).hexdigest()
