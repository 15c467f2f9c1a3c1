"""Commands for what is on a serial port: record it, look at its bytes."""

import argparse

from tracemesh.wire.device import Wheel
from tracemesh_bridge.commands.options import (
    Commands,
    add_command,
    add_port,
    add_recording_command,
    device,
    layout,
    positive,
    target,
)
from tracemesh_bridge.inspection import inspect
from tracemesh_bridge.record import record
from tracemesh_bridge.sources.morphorider import Morphorider, MorphoriderSettings


def add(commands: Commands) -> None:
    """Add `morphorider` and `inspect`."""
    command = add_recording_command(commands, "morphorider", "record a Morphorider on a serial port", _morphorider)
    add_port(command)
    option = command.add_argument
    option("--rate", type=positive, default=60.0, help="most samples per second (default %(default)g)")
    option("--circumference", type=positive, default=0.1, help="of the wheel, m (default %(default)g)")
    command = add_command(commands, "inspect", "show a frame's raw bytes beside the decoded values", _inspect)
    add_port(command)
    option = command.add_argument
    option("--count", type=int, default=20, help="frames to show (default %(default)d)")
    option("--interval", type=positive, default=0.5, help="s between two frames (default %(default)g)")


def _morphorider(args: argparse.Namespace) -> int:
    settings = MorphoriderSettings(args.port, args.rate, args.timeout, layout(args))
    wheel = Wheel(circumference=args.circumference, ticks_per_turn=settings.layout.ticks_per_turn)
    rider = device(args, "morphorider", wheel)
    return not record(target(args), rider, lambda host: Morphorider(settings, rider, host))


def _inspect(args: argparse.Namespace) -> int:
    for line in inspect(args.port, layout(args), args.timeout, args.count, args.interval):
        print(line, flush=True)
    return 0
