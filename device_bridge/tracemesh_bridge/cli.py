"""tracemesh-bridge: connects devices to a tracemesh server."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from platformdirs import user_data_path
from pydantic import TypeAdapter, ValidationError

from tracemesh.errors import TracemeshError
from tracemesh.wire.base import Identifier, Quaternion
from tracemesh.wire.device import Device, Wheel
from tracemesh_bridge.clock import Clock
from tracemesh_bridge.framing import FrameLayout, read_layout
from tracemesh_bridge.keys import KEYS_HELP
from tracemesh_bridge.record import TOKEN_VARIABLE, Target, record
from tracemesh_bridge.sources.morphorider import Morphorider, MorphoriderSettings
from tracemesh_bridge.sources.virtual import FAULTS, VirtualSettings, run_virtual

DEFAULT_SERVER = "http://127.0.0.1:8000"


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit status is 0 when all is done and sent, 1 when something is wrong, 2 for wrong usage."""
    args = parser().parse_args(argv)
    try:
        return int(args.run(args))
    except TracemeshError as error:
        print(f"tracemesh-bridge: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(
        prog="tracemesh-bridge", description="Connects devices to a tracemesh server.", epilog=KEYS_HELP
    )
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    for name, words, options, run in (
        ("morphorider", "record a Morphorider on a serial port", _morphorider_options, _morphorider),
        ("virtual", "be a Morphorider that scans a built-in shape", _virtual_options, _virtual),
    ):
        command = commands.add_parser(name, help=words, description=f"{words[0].upper()}{words[1:]}.", epilog=KEYS_HELP)
        options(command)
        command.set_defaults(run=run)
    return top


def _recording_options(command: argparse.ArgumentParser, kind: str) -> None:
    """Options of every command that records."""
    command.add_argument(
        "--server", default=DEFAULT_SERVER, help=f"address (default {DEFAULT_SERVER}); {TOKEN_VARIABLE} holds its token"
    )
    command.add_argument("--session", type=_identifier, help="record into this session (default: a new one)")
    command.add_argument("--spool", type=Path, help="folder for what is not sent yet (default: one per device)")
    command.add_argument(
        "--device", type=_identifier, default=kind, help="identity of the device (default: %(default)s)"
    )
    command.add_argument("--name", default="", help="name of the device for people")
    command.add_argument(
        "--mounting", type=_quaternion, default=(1.0, 0.0, 0.0, 0.0), metavar="W,X,Y,Z",
        help="turns the axes (tangent, normal, B) into the device's own axes (default: 1,0,0,0)",
    )  # fmt: skip


def _target(args: argparse.Namespace) -> Target:
    return Target(args.server, args.session, args.spool or user_data_path("tracemesh") / "spool" / args.device)


def _device(args: argparse.Namespace, kind: str, **more: Any) -> Device:
    return Device(id=args.device, kind=kind, name=args.name, mounting=args.mounting, **more)


def _morphorider_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("--port", required=True, help="serial port, or a pattern such as '/dev/rfcomm*'")
    _recording_options(command, "morphorider")
    command.add_argument("--rate", type=_positive, default=60.0, help="most samples per second (default %(default)g)")
    command.add_argument(
        "--timeout", type=_positive, default=0.25, help="s to wait for an answer (default %(default)g)"
    )
    command.add_argument("--layout", type=Path, help="JSON file that says which bytes of a frame mean what")
    command.add_argument("--circumference", type=_positive, default=0.1, help="of the wheel, m (default %(default)g)")


def _morphorider(args: argparse.Namespace) -> int:
    layout = read_layout(args.layout) if args.layout else FrameLayout()
    wheel = Wheel(circumference=args.circumference, ticks_per_turn=layout.ticks_per_turn)
    device = _device(args, "morphorider", wheel=wheel)
    settings = MorphoriderSettings(args.port, args.rate, args.timeout, layout)
    return not record(_target(args), device, lambda link, health: Morphorider(settings, device, link, health, Clock()))


def _virtual_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("--shape", default="leaf", help="built-in shape that it scans (default: %(default)s)")
    command.add_argument("--link", type=Path, help="symbolic link to the port, for a name known beforehand")
    command.add_argument("--speed", type=_positive, default=1.0, help="times faster than life (default %(default)g)")
    command.add_argument(
        "--pace", choices=("clock", "request"), default="clock",
        help="the ride goes on by itself, or by one reading per request (default: %(default)s)",
    )  # fmt: skip
    command.add_argument("--seed", type=int, default=0, help="of everything random (default %(default)d)")
    command.add_argument(
        "--noise", type=_fraction, default=1.0, help="factor on all imperfections (default %(default)g)"
    )
    command.add_argument("--log", type=Path, help="append each whole frame sent to this file, in hex")
    command.add_argument(
        "--unplug", type=int, metavar="N", help="vanish after N requests, come back under another name"
    )
    for fault in FAULTS:
        command.add_argument(f"--{fault}", type=_fraction, default=0.0, metavar="P", help="probability of this fault")


def _virtual(args: argparse.Namespace) -> int:
    faults = tuple((name, getattr(args, name)) for name in FAULTS)
    run_virtual(
        VirtualSettings(
            args.shape, args.speed, args.pace, args.seed, args.noise, args.link, faults, args.unplug, args.log
        )
    )
    return 0


def _checked(check: Callable[[str], Any], wanted: str) -> Callable[[str], Any]:
    def convert(text: str) -> Any:
        try:
            return check(text)
        except (ValueError, ValidationError) as error:
            raise argparse.ArgumentTypeError(f"wanted {wanted}, got {text!r}") from error

    return convert


def _number(text: str, lowest: float, exclusive: bool) -> float:
    value = float(text)
    if not lowest <= value < float("inf") or (exclusive and value == lowest):
        raise ValueError(text)
    return value


_positive = _checked(lambda text: _number(text, 0.0, exclusive=True), "a number above 0")
_fraction = _checked(lambda text: _number(text, 0.0, exclusive=False), "a number from 0 up")
_identifier = _checked(TypeAdapter(Identifier).validate_python, "up to 64 letters, digits, _ and -")
_quaternion = _checked(
    lambda text: TypeAdapter(Quaternion).validate_python(text.split(",")), "four numbers w,x,y,z separated by commas"
)
