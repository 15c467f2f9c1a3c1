"""For programs of tests that are to die in the middle of their work."""

import os
import signal

from sqlalchemy import event

from tracemesh.storage.database import Database


def kill_before(database: Database, statements: int) -> None:
    """Have this process kill itself before it sends one more than so many statements to a database."""
    sent = 0

    def count(*_: object) -> None:
        nonlocal sent
        sent += 1
        if sent > statements:
            os.kill(os.getpid(), signal.SIGKILL)

    event.listen(database.engine, "before_cursor_execute", count)
