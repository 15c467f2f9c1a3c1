"""`tracemesh serve`, what looks after a server, and `tracemesh demo`."""

from __future__ import annotations

import argparse
import gc
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tracemesh.cli.arguments import Commands, port
from tracemesh.terminal import ProgressLine

if TYPE_CHECKING:
    from tracemesh.settings import Settings


def add_serve(commands: Commands) -> None:
    """The server."""
    parser = commands.add_parser(
        "serve",
        help="run the server",
        description="Serve sessions, live view, reconstruction jobs and the web page. Settings: docs/settings.md.",
    )
    parser.add_argument("--host", help="address to listen on (default 127.0.0.1; any other demands a token)")
    parser.add_argument("--port", type=port, help="port to listen on (default 8000)")
    parser.add_argument("--data-dir", type=Path, metavar="DIR", help="where sessions and meshes are kept")
    parser.add_argument(
        "--lan",
        action="store_true",
        default=None,
        help="serve the local network over HTTPS, with a certificate for phones to trust",
    )
    parser.set_defaults(command=_serve)


def add_backup(commands: Commands) -> None:
    """All of a server in a folder."""
    parser = commands.add_parser(
        "backup",
        help="copy everything of a server to a folder",
        description="Copy database and results to a folder while the server runs; again: only what is new.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where to; made when it is missing")
    parser.add_argument("--data-dir", type=Path, metavar="DIR", help="data folder of the server")
    parser.set_defaults(command=_backup)


def add_doctor(commands: Commands) -> None:
    """What is wrong."""
    parser = commands.add_parser(
        "doctor",
        help="tell what is wrong with a server",
        description="Look at data folder, database, clock, results, executor, web page and port, and say in plain "
        "words what to mend.",
    )
    parser.add_argument("--host", help="address of the server (default 127.0.0.1)")
    parser.add_argument("--port", type=port, help="port of the server (default 8000)")
    parser.add_argument("--data-dir", type=Path, metavar="DIR", help="data folder of the server")
    parser.set_defaults(command=_doctor)


def add_demo(commands: Commands) -> None:
    """Server and virtual device in one."""
    parser = commands.add_parser(
        "demo",
        help="watch a virtual Morphorider scan a shape",
        description="Start a server and a virtual Morphorider; open the printed address to watch curves grow, become a "
        "network, become a surface.",
    )
    parser.add_argument("--headless", action="store_true", help="no browser: do the same work, write files, exit")
    parser.add_argument("--out", type=Path, metavar="DIR", help="with --headless: network.json, mesh.glb, report.json")
    parser.add_argument("--port", type=port, default=8000, help="port of the server (default 8000; 0: a free one)")
    parser.set_defaults(command=_demo)


def _settings(chosen: argparse.Namespace) -> Settings:
    from tracemesh.settings import Settings

    given = {name: vars(chosen).get(name) for name in ("host", "port", "data_dir", "lan")}
    return Settings(**{name: value for name, value in given.items() if value is not None})


def _serve(chosen: argparse.Namespace) -> int:
    gc.disable()  # until it serves: what modules make is no garbage, and looking through it takes a tenth of the start
    from tracemesh.api.server import serve

    serve(_settings(chosen))
    return 0


def _backup(chosen: argparse.Namespace) -> int:
    from tracemesh.storage.backup import back_up

    with ProgressLine() as progress:
        made = back_up(_settings(chosen), chosen.folder, progress)
    print(f"tracemesh: {made.database} and {made.artifacts - len(made.lost)} artifacts", file=sys.stderr)
    for digest in made.lost:
        print(f"tracemesh: artifact {digest} is missing or damaged at its source", file=sys.stderr)
    return 1 if made.lost else 0


def _doctor(chosen: argparse.Namespace) -> int:
    from tracemesh.doctor import examine

    ill = False
    for finding in examine(_settings(chosen)):
        print(finding)
        ill |= bool(finding.advice)
    return 1 if ill else 0


def _demo(chosen: argparse.Namespace) -> int:
    from tracemesh.demo import headless, watch

    if chosen.headless != (chosen.out is not None):
        raise argparse.ArgumentTypeError("--headless and --out DIR need each other")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the demo's own processes end with it
    if chosen.headless:
        return headless(chosen.out, chosen.port)
    return watch(chosen.port)
