"""Commands that are devices themselves."""

import argparse
from pathlib import Path

from tracemesh_bridge.commands.options import Commands, add_command, not_negative, positive
from tracemesh_bridge.sources.virtual import FAULTS, VirtualSettings, run_virtual


def add(commands: Commands) -> None:
    """Add `virtual`."""
    command = add_command(commands, "virtual", "be a Morphorider that scans a built-in shape", _virtual)
    option = command.add_argument
    option("--shape", default="leaf", help="built-in shape that it scans (default: %(default)s)")
    option("--link", type=Path, help="symbolic link to the port, for a name known beforehand")
    option("--speed", type=positive, default=1.0, help="times faster than life (default %(default)g)")
    option(
        "--pace", choices=("clock", "request"), default="clock",
        help="the ride goes on by itself, or by one reading per request (default: %(default)s)",
    )  # fmt: skip
    option("--seed", type=int, default=0, help="of everything random (default %(default)d)")
    option("--noise", type=not_negative, default=1.0, help="factor on all imperfections (default %(default)g)")
    option("--log", type=Path, help="append each whole frame sent to this file, in hex")
    option("--unplug", type=int, metavar="N", help="vanish after N requests, come back under another name")
    for fault in FAULTS:
        option(f"--{fault}", type=not_negative, default=0.0, metavar="P", help="probability of this fault")


def _virtual(args: argparse.Namespace) -> int:
    faults = tuple((name, getattr(args, name)) for name in FAULTS)
    settings = VirtualSettings(
        args.shape, args.speed, args.pace, args.seed, args.noise, args.link, faults, args.unplug, args.log
    )
    run_virtual(settings)
    return 0
