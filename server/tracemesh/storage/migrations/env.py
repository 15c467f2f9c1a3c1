"""How alembic runs: on the connection that `Database` gives it."""

from alembic import context
from sqlalchemy import Connection

from tracemesh.storage.models import Base


def migrate(connection: Connection) -> None:
    """Run the migrations inside the connection's own transaction."""
    context.configure(connection=connection, target_metadata=Base.metadata, render_as_batch=True)
    context.run_migrations()


migrate(context.config.attributes["connection"])
