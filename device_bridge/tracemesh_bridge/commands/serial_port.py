"""Commands for what is on a serial port: record it, calibrate it, look at its bytes."""

import argparse
from pathlib import Path

from tracemesh.wire.device import Device, Wheel
from tracemesh_bridge.commands.options import (
    Commands,
    add_command,
    add_port,
    add_recording_command,
    calibrated,
    count,
    device,
    identifier,
    layout,
    name_for_people,
    positive,
    target,
    vector,
)
from tracemesh_bridge.console import Console
from tracemesh_bridge.doctor import examine
from tracemesh_bridge.health import Host
from tracemesh_bridge.inspection import inspect
from tracemesh_bridge.record import TOKEN_VARIABLE, record
from tracemesh_bridge.source import Link
from tracemesh_bridge.sources.morphorider import Morphorider, MorphoriderSettings


def add(commands: Commands) -> None:
    """Add `morphorider`, `calibrate`, `inspect` and `doctor`."""
    command = add_recording_command(commands, "morphorider", "record a Morphorider on a serial port", _morphorider)
    add_port(command)
    option = command.add_argument
    option("--rate", type=positive, default=60.0, help="most samples per second (default %(default)g)")
    option("--circumference", type=positive, default=0.1, help="of the wheel, m (default %(default)g)")
    option(
        "--wheel-offset", type=vector, default=(0.0, 0.0, 0.0), metavar="T,N,B",
        help="m along (tangent, normal, B), of the wheel from the surface under the sensors (default 0,0,0)",
    )  # fmt: skip
    option("--calibration", type=Path, metavar="CAL.json", help="of this device: have the recording corrected by it")
    command = add_command(
        commands,
        "calibrate",
        "find out what a Morphorider's sensors and wheel get wrong (not a phone's: it calibrates itself)",
        _calibrate,
    )
    add_port(command)
    option = command.add_argument
    option("--device", type=identifier, default="morphorider", help="identity of the device (default: %(default)s)")
    option("--length", type=positive, default=1.0, help="m, of a straight line by a ruler (default %(default)g)")
    option("--place", type=name_for_people, default="", help="where you are, for people")
    option("--output", type=Path, metavar="CAL.json", help="file to write (default: DEVICE.calibration.json)")
    option("--server", help=f"also store it there; {TOKEN_VARIABLE} holds its token")
    option("--rate", type=positive, default=60.0, help="most samples per second (default %(default)g)")
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
    ticks = settings.layout.ticks_per_turn
    wheel = Wheel(circumference=args.circumference, ticks_per_turn=ticks, offset=args.wheel_offset)
    rider = device(args, "morphorider", wheel)
    if args.calibration:
        from tracemesh_bridge.distortion import read_file  # late: it needs the kernel

        rider = calibrated(rider, read_file(args.calibration))
    return not record(target(args), rider, lambda host: Morphorider(settings, rider, host))


def _calibrate(args: argparse.Namespace) -> int:
    from tracemesh_bridge.calibrate import run, save, send  # late: they need the kernel
    from tracemesh_bridge.calibration import Procedure, describe

    settings = MorphoriderSettings(args.port, args.rate, args.timeout, layout(args))
    rider = Device(id=args.device, kind="morphorider", wheel=Wheel(ticks_per_turn=settings.layout.ticks_per_turn))
    console = Console()
    host = Host(Link("device", console.say))
    found = run(Morphorider(settings, rider, host), Procedure(rider, args.length, args.place), console)
    for line in describe(found):
        console.say(line)
    file = args.output or Path(f"{args.device}.calibration.json")
    save(found, file)
    console.say(f"written to {file}")
    if args.server:
        found = send(found, rider.kind, args.server)
        save(found, file)
        console.say(f"{args.server} has it as {found.label}")
    return 0


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
