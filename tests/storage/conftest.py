"""A migrated database of each kind."""

from collections.abc import Iterator

import pytest

from tracemesh.storage.database import Database


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    """A migrated database, once of each kind."""
    database = Database(database_url)
    database.migrate()
    yield database
    database.close()
