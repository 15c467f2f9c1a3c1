"""Commands for fixed arrays of sensors."""

import argparse
import json
from pathlib import Path

from pydantic import ValidationError

from tracemesh.wire.device import Device
from tracemesh_bridge.commands.options import (
    Commands,
    add_command,
    add_recording_command,
    count,
    device,
    not_negative,
    positive,
    target,
    whole,
)
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.record import record
from tracemesh_bridge.sources.program import Program

SHAPES = ("ribbon", "comb", "lattice")


def add(commands: Commands) -> None:
    """Add `array` and `virtual-array`."""
    command = add_recording_command(commands, "array", "record a fixed array of sensors", _array)
    option = command.add_argument
    option("--topology", type=Path, required=True, help="JSON file that declares which sensors are where")
    option("program", nargs="+", metavar="PROGRAM", help="prints one reading a line; its arguments follow after --")
    command = add_command(commands, "virtual-array", "print what a moving array measures, a line a reading", _virtual)
    option = command.add_argument
    option("shape", choices=SHAPES, help="a ribbon that rolls up, or a comb or lattice that waves")
    option("--declare", action="store_true", help="print its topology instead")
    option("--rate", type=positive, default=30.0, help="readings per second (default %(default)g)")
    option("--readings", type=count, metavar="N", help="stop after N readings (default: never)")
    option("--seed", type=whole, default=0, help="of the noise (default %(default)d)")
    option("--noise", type=not_negative, default=1.0, help="factor on that of a good sensor (default %(default)g)")


def _array(args: argparse.Namespace) -> int:
    declared = _declared(args.topology, device(args, "array"))
    return not record(target(args), declared, lambda host: Program(args.program, declared, host))


def _declared(path: Path, device: Device) -> Device:
    """The device with the array, and what else of a device the file declares. Raises BridgeError."""
    try:
        text = path.read_text(encoding="utf-8")
        declared = Device.model_validate(device.model_dump() | json.loads(text))
    except (OSError, UnicodeDecodeError) as error:
        raise BridgeError(f"cannot read the topology {path}: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise BridgeError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    except (ValueError, TypeError) as error:
        raise BridgeError(f'{path}: wanted a JSON object such as {{"array": ...}}: {error}') from error
    if declared.array is None:
        raise BridgeError(f'{path}: wanted {{"array": {{"curves": [...]}}}}, got no array')
    return declared


def _virtual(args: argparse.Namespace) -> int:
    from tracemesh.geometry.simulated.moving_arrays import ARRAYS  # late: they need scipy
    from tracemesh_bridge.sources.virtual_array import VirtualArraySettings, declare, run_virtual_array

    if args.declare:
        print(json.dumps({"array": declare(ARRAYS[args.shape]()).model_dump()}))
    else:
        run_virtual_array(VirtualArraySettings(args.shape, args.rate, args.noise, args.seed, args.readings))
    return 0
