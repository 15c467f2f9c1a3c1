"""Lists in pages: each page begins after the last thing of the one before, so that nothing new disturbs the order."""

from typing import Any, TypeVar

from sqlalchemy import Select

from tracemesh.storage.models import BatchRow, ReconstructionRow, SessionRow

Dated = BatchRow | ReconstructionRow | SessionRow
Query = TypeVar("Query", bound=Select[Any])


def newest_first(query: Query, table: type[Dated], last: Dated | None, limit: int) -> Query:
    """At most `limit` rows of a table, newest first, that come after the row `last`."""
    ordered = query.order_by(table.created.desc(), table.id.desc()).limit(limit)
    if last is None:
        return ordered
    same_time = (table.created == last.created) & (table.id < last.id)
    return ordered.where((table.created < last.created) | same_time)
