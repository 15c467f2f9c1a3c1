"""`tracemesh serve` and `tracemesh demo`."""

import argparse
import signal
from pathlib import Path

from tracemesh.cli.arguments import Commands, port


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
    parser.set_defaults(command=_serve)


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


def _serve(chosen: argparse.Namespace) -> int:
    from tracemesh.api.server import serve
    from tracemesh.settings import Settings

    given = {"host": chosen.host, "port": chosen.port, "data_dir": chosen.data_dir}
    serve(Settings(**{name: value for name, value in given.items() if value is not None}))
    return 0


def _demo(chosen: argparse.Namespace) -> int:
    from tracemesh.demo import headless, watch

    if chosen.headless != (chosen.out is not None):
        raise argparse.ArgumentTypeError("--headless and --out DIR need each other")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the demo's own processes end with it
    if chosen.headless:
        return headless(chosen.out, chosen.port)
    return watch(chosen.port)
