"""Curves and marks: derived from what was sent, editable."""

from collections.abc import Iterable
from typing import Any

from sqlalchemy import ColumnElement, delete, select
from sqlalchemy.orm import Session as Transaction

from tracemesh.errors import InputError, NotFound
from tracemesh.storage.models import CurveRow, MarkRow, RecordingRow
from tracemesh.storage.sessions import session_row
from tracemesh.wire.resources import Curve, CurveUpdate, Mark, MeasuredLength


def list_curves(transaction: Transaction, session: str, limit: int | None = None, first: int = 0) -> list[Curve]:
    """At most `limit` curves of a session from an index on, less those that were removed; raises NotFound."""
    session_row(transaction, session)
    return [_curve(transaction, row) for row in curve_rows(transaction, session, limit, first)]


def get_curve(transaction: Transaction, session: str, index: int) -> Curve:
    """One curve; raises NotFound."""
    return _curve(transaction, _row(transaction, session, index))


def update_curve(transaction: Transaction, session: str, index: int, change: CurveUpdate) -> Curve:
    """Change what the update names. Raises NotFound, and InputError for a mark beyond the curve's samples."""
    row = _row(transaction, session, index)
    for name in ("boundary", "closed", "removed"):
        value = getattr(change, name)
        if value is not None:
            setattr(row, name, value)
    if change.marks is not None:
        row.lengths = _carried(row.lengths, marks_of(transaction, row), change.marks)
        replace_marks(transaction, row, change.marks)
    if change.lengths is not None:
        replace_lengths(row, change.lengths)
    transaction.flush()
    return _curve(transaction, row)


def replace_lengths(row: CurveRow, lengths: Iterable[MeasuredLength]) -> None:
    """Give a curve these measured lengths instead of its own; raises InputError for one beyond its samples."""
    known = [length.model_dump() for length in lengths]
    for entry in known:
        if (beyond := max(entry["first"], entry["last"])) >= row.samples:
            raise InputError(f"curve {row.index} has {row.samples} samples, got a length at sample {beyond}")
    row.lengths = known


def _carried(lengths: list[dict[str, Any]], old: list[Mark], new: list[Mark]) -> list[dict[str, Any]]:
    """Lengths between marks that were moved: what was measured is between the nodes, wherever they are marked."""
    if len(old) != len(new):
        return lengths
    moved = dict(zip(sorted(m.sample for m in old), sorted(m.sample for m in new), strict=True))
    ends = ("first", "last")
    return [{**entry, **{end: moved.get(entry[end], entry[end]) for end in ends}} for entry in lengths]


def replace_marks(transaction: Transaction, row: CurveRow, marks: Iterable[Mark]) -> None:
    """Give a curve these marks instead of its own; raises InputError for one beyond its samples."""
    transaction.execute(delete(MarkRow).where(_belongs_to(row)))
    for mark in marks:
        if mark.sample >= row.samples:
            raise InputError(f"curve {row.index} has {row.samples} samples, got a mark at sample {mark.sample}")
        transaction.add(MarkRow(recording_key=row.recording_key, number=row.number, sample=mark.sample, node=mark.node))


def curve_rows(transaction: Transaction, session: str, limit: int | None = None, first: int = 0) -> list[CurveRow]:
    """Rows of the curves that were not removed, in the order of scanning; at most `limit` from an index on."""
    kept = (CurveRow.session_id == session) & (CurveRow.index >= first) & ~CurveRow.removed
    return list(transaction.scalars(select(CurveRow).where(kept).order_by(CurveRow.index).limit(limit)))


def _row(transaction: Transaction, session: str, index: int) -> CurveRow:
    row = transaction.get(CurveRow, (session, index))
    if row is None:
        raise NotFound(f"there is no curve {index} in session {session}")
    return row


def marks_of(transaction: Transaction, row: CurveRow) -> list[Mark]:
    """Marks of a curve in the order of its samples."""
    query = select(MarkRow).where(_belongs_to(row)).order_by(MarkRow.sample, MarkRow.key)
    return [Mark(sample=mark.sample, node=mark.node) for mark in transaction.scalars(query)]


def _belongs_to(row: CurveRow) -> ColumnElement[bool]:
    return (MarkRow.recording_key == row.recording_key) & (MarkRow.number == row.number)


def _curve(transaction: Transaction, row: CurveRow) -> Curve:
    return Curve(
        index=row.index,
        recording=transaction.get_one(RecordingRow, row.recording_key).id,
        boundary=row.boundary,
        closed=row.closed,
        ended=row.ended,
        samples=row.samples,
        length=row.length,
        marks=marks_of(transaction, row),
        lengths=[MeasuredLength.model_validate(entry) for entry in row.lengths],
    )
