"""A table of measured figures: the one type that every benchmark returns, as Markdown and as JSON."""

from dataclasses import dataclass
from typing import Any

Cell = str | int | float | None


@dataclass(frozen=True)
class Column:
    """title: head of the column, unit included. format: of its numbers, as in an f-string."""

    title: str
    format: str = ""


@dataclass(frozen=True)
class Table:
    """name: as on the command line. notes: paragraphs below the table, however they are broken into lines. A cell that
    is None has no figure.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"{self.name}: wanted {len(self.columns)} cells a row, got {len(row)}: {row}")

    def markdown(self) -> str:
        """Heading, table with aligned columns, notes."""
        texts = [[c.title for c in self.columns]]
        texts += [[_text(cell, c.format) for cell, c in zip(row, self.columns, strict=True)] for row in self.rows]
        widths = [max(len(text) for text in column) for column in zip(*texts, strict=True)]
        head, *body = [_line(row, widths) for row in texts]
        rule = _line(["-" * (w - 1) + ":" if k else "-" * w for k, w in enumerate(widths)], widths)
        notes = [f"\n{_joined(note)}" for note in self.notes]
        return "\n".join([f"## {self.title}\n", head, rule, *body, *notes]) + "\n"

    @classmethod
    def read(cls, document: dict[str, Any]) -> "Table":
        """The table that `document` describes."""
        columns = tuple(Column(**column) for column in document["columns"])
        rows = tuple(tuple(row) for row in document["rows"])
        return cls(document["name"], document["title"], columns, rows, tuple(document["notes"]))

    def document(self) -> dict[str, Any]:
        """The same as plain JSON, numbers unrounded."""
        return {
            "name": self.name,
            "title": self.title,
            "columns": [{"title": c.title, "format": c.format} for c in self.columns],
            "rows": [list(row) for row in self.rows],
            "notes": [_joined(note) for note in self.notes],
        }


def _text(cell: Cell, form: str) -> str:
    if cell is None:
        return "–"
    return cell if isinstance(cell, str) else format(cell, form)


def _joined(note: str) -> str:
    return " ".join(note.split())


def _line(cells: list[str], widths: list[int]) -> str:
    padded = [c.rjust(w) if k else c.ljust(w) for k, (c, w) in enumerate(zip(cells, widths, strict=True))]
    return f"| {' | '.join(padded)} |"
