"""Commands for what is on a serial port: record it, look at its bytes."""

import argparse

from tracemesh.wire.device import Wheel
from tracemesh_bridge.commands.options import (
    Commands,
    add_command,
    add_port,
    add_recording_command,
    count,
    device,
    layout,
    positive,
    target,
)
from tracemesh_bridge.doctor import examine
from tracemesh_bridge.inspection import inspect
from tracemesh_bridge.record import record
from tracemesh_bridge.sources.morphorider import Morphorider, MorphoriderSettings


def add(commands: Commands) -> None:
    """Add `morphorider`, `inspect` and `doctor`."""
    command = add_recording_command(commands, "morphorider", "record a Morphorider on a serial port", _morphorider)
    add_port(command)
    option = command.add_argument
    option("--rate", type=positive, default=60.0, help="most samples per second (default %(default)g)")
    option("--circumference", type=positive, default=0.1, help="of the wheel, m (default %(default)g)")
    command = add_command(commands, "inspect", "show a frame's raw bytes beside the decoded values", _inspect)
    add_port(command)
    option = command.add_argument
    option("--count", type=count, default=20, help="frames to show (default %(default)d)")
    option("--interval", type=positive, default=0.5, help="s between two frames (default %(default)g)")
    command = add_command(commands, "doctor", "tell what is wrong with a device, its port or the server", _doctor)
    add_port(command)
    command.add_argument("--server", help="also look whether this server takes recordings")
    command.add_argument("--seconds", type=positive, default=5.0, help="to look at the device (default %(default)g)")


def _morphorider(args: argparse.Namespace) -> int:
    settings = MorphoriderSettings(args.port, args.rate, args.timeout, layout(args))
    wheel = Wheel(circumference=args.circumference, ticks_per_turn=settings.layout.ticks_per_turn)
    rider = device(args, "morphorider", wheel)
    return not record(target(args), rider, lambda host: Morphorider(settings, rider, host))


def _doctor(args: argparse.Namespace) -> int:
    settings = MorphoriderSettings(args.port, timeout=args.timeout, layout=layout(args))
    wrong = 0
    for finding in examine(settings, args.seconds, args.server):
        print(finding, flush=True)
        wrong += bool(finding.advice)
    return int(wrong > 0)


def _inspect(args: argparse.Namespace) -> int:
    for line in inspect(args.port, layout(args), args.timeout, args.count, args.interval):
        print(line, flush=True)
    return 0
