"""The command line: arguments in, files out. Messages go to stderr, data to stdout.

Exit status: 0 done; 1 the input cannot be reconstructed (says why and where); 2 usage.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from tracemesh.cli.reconstruct import add_reconstruct, add_surface
from tracemesh.cli.service import add_backup, add_demo, add_doctor, add_serve
from tracemesh.cli.shapes import add_evaluate, add_simulate
from tracemesh.cli.tokens import add_token
from tracemesh.errors import TracemeshError


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of `tracemesh`; never returns."""
    parser = build_parser()
    chosen = parser.parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = chosen.command
    try:
        status = command(chosen)
    except (TracemeshError, OSError) as error:
        print(f"tracemesh: {error}", file=sys.stderr)
        status = 1
    except argparse.ArgumentTypeError as error:
        parser.error(str(error))
    except ValidationError as error:
        parser.error("; ".join(map(_in_words, error.errors())))
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)


def _in_words(fault: ErrorDetails) -> str:
    where = ".".join(map(str, fault["loc"]))
    return f"{where + ': ' if where else ''}{fault['msg'].removeprefix('Value error, ')}"


def build_parser() -> argparse.ArgumentParser:
    """The whole grammar; docs/cli.md names every option of it."""
    parser = argparse.ArgumentParser(
        prog="tracemesh",
        description="Curve networks and surfaces from orientations measured along curves.",
        epilog="First steps:  tracemesh demo   |   tracemesh simulate leaf -o leaf.rawnet && "
        "tracemesh reconstruct leaf.rawnet -o leaf.glb",
    )
    parser.add_argument("--version", action="version", version=f"tracemesh {version('tracemesh')}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    of_files = (add_reconstruct, add_surface, add_evaluate, add_simulate)
    of_servers = (add_serve, add_token, add_backup, add_doctor, add_demo)
    for add in (*of_files, *of_servers):
        add(commands)
    return parser
