"""Commands that are devices themselves."""

import argparse
from pathlib import Path

from tracemesh_bridge.commands.options import (
    Commands,
    add_command,
    checked,
    count,
    not_negative,
    port_number,
    positive,
    probability,
    whole,
)
from tracemesh_bridge.sources.virtual import FAULTS, VirtualSettings, run_virtual

APPS = ("sensorserver", "sensorlogger", "phyphox")


def add(commands: Commands) -> None:
    """Add `virtual` and `virtual-phone`."""
    command = add_command(commands, "virtual", "be a Morphorider that scans a built-in shape", _virtual)
    _add_ride(command)
    option = command.add_argument
    option("--link", type=Path, help="symbolic link to the port, for a name known beforehand")
    option(
        "--pace", choices=("clock", "request"), default="clock",
        help="the ride goes on by itself, or by one reading per request (default: %(default)s)",
    )  # fmt: skip
    option("--log", type=Path, help="append each whole frame sent to this file, in hex")
    option("--calibrating", action="store_true", help="be led through a calibration instead of over a shape")
    option("--distortion", type=Path, metavar="CAL.json", help="err as this calibration would correct")
    option("--unplug", type=count, metavar="N", help="vanish after N requests, come back under another name")
    for fault in FAULTS:
        option(f"--{fault}", type=probability, default=0.0, metavar="P", help="probability of this fault")
    command = add_command(commands, "virtual-phone", "be a phone that scans a built-in shape", _virtual_phone)
    _add_ride(command)
    option = command.add_argument
    option("--app", choices=APPS, required=True, help="app that it runs")
    option("--port", type=port_number, default=0, help="port to serve at (default: a free one); not for sensorlogger")
    option(
        "--url", type=_url, default="http://127.0.0.1:8200", help="where sensorlogger posts to (default: %(default)s)"
    )
    option("--rate", type=positive, default=100.0, help="samples per second of the ride (default %(default)g)")
    option("--repeat", type=probability, default=0.0, metavar="P", help="probability that a post is sent twice")
    option("--reorder", type=probability, default=0.0, metavar="P", help="probability that a post is overtaken")
    option("--clock-jump", type=float, default=0.0, metavar="S", help="s by which its clock is set after 10 s")


def _add_ride(command: argparse.ArgumentParser) -> None:
    option = command.add_argument
    option("--shape", default="leaf", help="built-in shape that it scans (default: %(default)s)")
    option("--speed", type=positive, default=1.0, help="times faster than life (default %(default)g)")
    option("--seed", type=whole, default=0, help="of everything random (default %(default)d)")
    option("--noise", type=not_negative, default=1.0, help="factor on all imperfections (default %(default)g)")


def _virtual(args: argparse.Namespace) -> int:
    faults = tuple((name, getattr(args, name)) for name in FAULTS)
    ride = (args.shape, args.speed, args.pace, args.seed, args.noise)
    more = (args.unplug, args.log, args.calibrating, args.distortion)
    settings = VirtualSettings(*ride, args.link, faults, *more)
    run_virtual(settings)
    return 0


def _virtual_phone(args: argparse.Namespace) -> int:
    from tracemesh_bridge.sources.virtual_phone import VirtualPhoneSettings, run_virtual_phone  # late: needs scipy

    ride = (args.shape, args.speed, args.rate, args.seed, args.noise)
    faults = (args.repeat, args.reorder, args.clock_jump)
    run_virtual_phone(VirtualPhoneSettings(args.app, args.port, args.url, *ride, *faults))
    return 0


def _http(text: str) -> str:
    if not text.startswith(("http://", "https://")):
        raise ValueError(text)
    return text


_url = checked(_http, "an address such as http://127.0.0.1:8200")
