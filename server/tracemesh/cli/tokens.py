"""`tracemesh token`: who is let in, told to the server's database, whether the server runs or not."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tracemesh.cli.arguments import Commands, days

if TYPE_CHECKING:
    from datetime import datetime

    from tracemesh.storage.database import Database
    from tracemesh.wire.access import Token

DAY = 86400
"""s"""


def add_token(commands: Commands) -> None:
    """Create, list, revoke."""
    description = "Let people, programs and devices in from elsewhere, see who is let in, and end that."
    parser = commands.add_parser("token", help="say who may come in from elsewhere", description=description)
    actions = parser.add_subparsers(required=True, metavar="ACTION", help="create, list or revoke")
    create = actions.add_parser("create", description="Make a token and print it: the only time that it is told.")
    create.add_argument(
        "--role", choices=("viewer", "device", "owner"), default="viewer", help="what for (default viewer)"
    )
    create.add_argument("--session", metavar="ID", help="the only session that it opens (default: the whole server)")
    create.add_argument("--days", type=days, metavar="N", help="how long it lasts (default: until it is revoked)")
    create.add_argument("--name", default="", help="who or what it is for")
    create.set_defaults(command=_create)
    listing = actions.add_parser("list", description="Print all tokens that are good, without their secrets.")
    listing.set_defaults(command=_list)
    revoke = actions.add_parser("revoke", description="Let the bearer of a token in no more.")
    revoke.add_argument("id", metavar="ID", help="as `tracemesh token list` prints it")
    revoke.set_defaults(command=_revoke)
    for action in (create, listing, revoke):
        action.add_argument("--data-dir", type=Path, metavar="DIR", help="data folder of the server")


def _create(chosen: argparse.Namespace) -> int:
    from tracemesh.storage.tokens import create_token
    from tracemesh.wire.access import TokenCreate

    lasts = None if chosen.days is None else round(chosen.days * DAY)
    wanted = TokenCreate(role=chosen.role, session=chosen.session, name=chosen.name, expires_in=lasts)
    with _database(chosen).write() as transaction:
        print(create_token(transaction, wanted).token)
    return 0


def _list(chosen: argparse.Namespace) -> int:
    from tracemesh.storage.tokens import list_tokens

    with _database(chosen).read() as transaction:
        for token in list_tokens(transaction):
            print(_in_words(token))
    return 0


def _revoke(chosen: argparse.Namespace) -> int:
    from tracemesh.storage.tokens import revoke_token

    with _database(chosen).write() as transaction:
        revoke_token(transaction, chosen.id)
    return 0


def _database(chosen: argparse.Namespace) -> Database:
    from tracemesh.settings import Settings
    from tracemesh.storage.database import Database, database_faults_in_words

    settings = Settings() if chosen.data_dir is None else Settings(data_dir=chosen.data_dir)
    with database_faults_in_words():
        database = Database(settings.resolved_database_url)
        database.migrate()
    return database


def _in_words(token: Token) -> str:
    where = f"session {token.session}" if token.session else "whole server"
    ends = f"until {_time(token.expires)}" if token.expires else "until revoked"
    used = f"used {_time(token.last_used)}" if token.last_used else "never used"
    return "  ".join([token.id, f"{token.role:6}", where, ends, used, token.name]).rstrip()


def _time(time: datetime) -> str:
    return f"{time:%Y-%m-%d %H:%M} UTC"
