"""Options that commands share, and the kinds of values that options take."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from platformdirs import user_data_path
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from tracemesh.wire.base import Identifier, Name, UnitQuaternion
from tracemesh.wire.calibration import Calibration
from tracemesh.wire.device import Device, Wheel
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.framing import FrameLayout, read_layout
from tracemesh_bridge.keys import KEYS_HELP
from tracemesh_bridge.record import TOKEN_VARIABLE, Target

Commands = Any
"""What argparse's add_subparsers returns; its type has no public name."""
Run = Callable[[argparse.Namespace], int]
DEFAULT_SERVER = "http://127.0.0.1:8000"


def add_command(commands: Commands, name: str, words: str, run: Run, epilog: str = "") -> argparse.ArgumentParser:
    """A command that does `words` by calling `run`, which returns the exit status."""
    command: argparse.ArgumentParser = commands.add_parser(
        name, help=words, description=f"{words[0].upper()}{words[1:]}.", epilog=epilog
    )
    command.set_defaults(run=run)
    return command


def add_recording_command(commands: Commands, name: str, words: str, run: Run) -> argparse.ArgumentParser:
    """A command that records a device whose kind is the command's name."""
    command = add_command(commands, name, words, run, KEYS_HELP)
    add_server(command)
    option = command.add_argument
    option("--session", type=identifier, help="record into this session (default: a new one)")
    option("--spool", type=Path, help="folder for what is not sent yet (default: one per device)")
    option("--device", type=identifier, default=name, help="identity of the device (default: %(default)s)")
    option("--name", type=name_for_people, default="", help="name of the device for people")
    option(
        "--mounting", type=quaternion, default=(1.0, 0.0, 0.0, 0.0), metavar="W,X,Y,Z",
        help="turns the axes (tangent, normal, B) into the device's own axes; the default is the device's usual one",
    )  # fmt: skip
    return command


def add_server(command: argparse.ArgumentParser) -> None:
    """Where the server is."""
    words = f"address (default {DEFAULT_SERVER}); {TOKEN_VARIABLE} holds its token"
    command.add_argument("--server", default=DEFAULT_SERVER, help=words)


def add_port(command: argparse.ArgumentParser) -> None:
    """How to reach a Morphorider."""
    option = command.add_argument
    option("--port", required=True, help="serial port, or a pattern such as '/dev/rfcomm*'")
    option("--timeout", type=positive, default=0.25, help="s to wait for an answer (default %(default)g)")
    option("--layout", type=Path, help="JSON file that says which bytes of a frame mean what")


def target(args: argparse.Namespace) -> Target:
    """Where a recording command records to."""
    return Target(args.server, args.session, args.spool or user_data_path("tracemesh") / "spool" / args.device)


def device(args: argparse.Namespace, kind: str, wheel: Wheel | None = None) -> Device:
    """The device that a recording command describes."""
    return Device(id=args.device, kind=kind, name=args.name, mounting=args.mounting, wheel=wheel)


def calibrated(device: Device, calibration: Calibration) -> Device:
    """The device with its calibration. Raises BridgeError if it is another one's."""
    if calibration.device != device.id:
        raise BridgeError(
            f"wanted a calibration of the device {device.id}, got one of {calibration.device}; see --device"
        )
    return device.model_copy(update={"calibration": calibration})


def layout(args: argparse.Namespace) -> FrameLayout:
    """The layout asked for, or the default. Raises BridgeError."""
    return read_layout(args.layout) if args.layout else FrameLayout()


def checked(check: Callable[[str], Any], wanted: str) -> Callable[[str], Any]:
    """A type for argparse that says what was wanted when `check` raises."""

    def convert(text: str) -> Any:
        try:
            return check(text)
        except (ValueError, ValidationError) as error:
            raise argparse.ArgumentTypeError(f"wanted {wanted}, got {text!r}") from error

    return convert


def _number(text: str, zero: bool, most: float = sys.float_info.max) -> float:
    value = float(text)
    if not 0 <= value <= most or (value == 0 and not zero):
        raise ValueError(text)
    return value


def _whole(text: str, least: int, most: float = float("inf")) -> int:
    value = int(text)
    if not least <= value <= most:
        raise ValueError(text)
    return value


positive = checked(lambda text: _number(text, zero=False), "a number above 0")
not_negative = checked(lambda text: _number(text, zero=True), "a number from 0 up")
probability = checked(lambda text: _number(text, zero=True, most=1.0), "a probability from 0 to 1")
whole = checked(lambda text: _whole(text, 0), "a whole number from 0 up")
count = checked(lambda text: _whole(text, 1), "a whole number from 1 up")
port_number = checked(lambda text: _whole(text, 0, 65535), "a port from 0 to 65535")
identifier = checked(TypeAdapter(Identifier).validate_python, "up to 64 letters, digits, _ and -")
name_for_people = checked(TypeAdapter(Name).validate_python, "up to 200 characters, none of them a control character")
vector = checked(
    lambda text: TypeAdapter(tuple[FiniteFloat, FiniteFloat, FiniteFloat]).validate_python(text.split(",")),
    "three numbers separated by commas",
)
quaternion = checked(
    lambda text: TypeAdapter(UnitQuaternion).validate_python(text.split(",")),
    "a rotation: four numbers w,x,y,z separated by commas, of length 1",
)
