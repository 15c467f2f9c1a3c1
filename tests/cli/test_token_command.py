"""`tracemesh token`: made here, good there."""

from pathlib import Path
from typing import Any

import pytest

from tracemesh.cli import main
from tracemesh.settings import Settings
from tracemesh.storage.database import Database
from tracemesh.storage.sessions import create_session
from tracemesh.storage.tokens import cookie_of, digest_of, find_token
from tracemesh.wire.resources import SessionCreate


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """Run `tracemesh token ...` on a data folder; status, output, messages."""

    def run(*arguments: str) -> tuple[object, str, str]:
        with pytest.raises(SystemExit) as ending:
            main(["token", *arguments, "--data-dir", str(tmp_path)])
        said = capsys.readouterr()
        return ending.value.code, said.out, said.err

    return run


@pytest.fixture
def database(tmp_path: Path) -> Any:
    database = Database(Settings(data_dir=tmp_path).resolved_database_url)
    database.migrate()
    yield database
    database.close()


def test_made_listed_and_revoked(run: Any, database: Database) -> None:
    with database.write() as transaction:
        create_session(transaction, SessionCreate(id="lamp"))
    arguments = ("--role", "device", "--session", "lamp", "--days", "7", "--name", "phone")
    status, secret, _ = run("create", *arguments)
    assert status == 0
    with database.read() as transaction:
        found = find_token(transaction, digest_of(cookie_of(secret.strip())))
    assert found is not None
    assert (found.role, found.session, found.name) == ("device", "lamp", "phone")
    assert found.expires is not None
    assert (found.expires - found.created).days == 7
    _, listed, _ = run("list")
    assert found.id in listed
    assert "session lamp" in listed
    assert secret.strip() not in listed
    assert run("revoke", found.id)[0] == 0
    assert run("list")[1] == ""


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (["create", "--session", "none"], 1, "there is no session none"),
        (["create", "--days", "-1"], 2, "a number of days"),
        (["create", "--role", "king"], 2, "invalid choice"),
        (["revoke", "none"], 1, "there is no token none"),
    ],
)
def test_what_cannot_be_done_is_said(run: Any, arguments: list[str], status: int, says: str) -> None:
    code, out, err = run(*arguments)
    assert (code, out) == (status, "")
    assert says in err
