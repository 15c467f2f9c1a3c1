"""tracemesh-bridge: connects devices to a tracemesh server."""

import argparse
import sys
from collections.abc import Sequence

from tracemesh.errors import TracemeshError
from tracemesh_bridge.commands import arrays, phones, recordings, serial_port, simulated


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit status is 0 when all is done and sent, 1 when something is wrong, 2 for wrong usage."""
    args = parser().parse_args(argv)
    try:
        return int(args.run(args))
    except (TracemeshError, OSError) as error:
        print(f"tracemesh-bridge: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(prog="tracemesh-bridge", description="Connects devices to a tracemesh server.")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    for group in (serial_port, phones, arrays, recordings, simulated):
        group.add(commands)
    return top
