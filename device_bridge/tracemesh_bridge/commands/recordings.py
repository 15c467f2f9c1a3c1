"""Commands for recordings in files."""

import argparse
import sys
from pathlib import Path

from tracemesh_bridge.commands.options import Commands, add_command, add_server, checked, identifier, positive
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.mrider import read_mrider
from tracemesh_bridge.replay import RecordedFile, replay


def add(commands: Commands) -> None:
    """Add `replay` and `mrider`."""
    command = add_command(commands, "replay", "send a recording that lies in a file", _replay)
    add_server(command)
    option = command.add_argument
    option("file", type=Path, help="recording: newline-delimited JSON that begins with hello")
    option("--session", type=identifier, help="into this session (default: the one it was recorded into)")
    option("--recording", type=identifier, help="as another recording, if the server has it already")
    option("--speed", type=positive, help="times faster than it was recorded (default: at once)")
    command = add_command(commands, "mrider", "make a recording of an mrider.txt file", _mrider)
    option = command.add_argument
    option("file", type=Path, help="mrider.txt")
    option("--recording", type=identifier, default="mrider", help="name of the recording (default: %(default)s)")
    option(
        "--frames", choices=("transposed", "direct"), default="transposed",
        help="its vectors: North and Up in the phone, or the phone's y and z in the world (default: %(default)s)",
    )  # fmt: skip
    option(
        "--nodes", type=_node_numbers, action="append", default=[], metavar="N,N,...",
        help="numbers of a curve's nodes; once for each curve (default: all nodes are different)",
    )  # fmt: skip


def _replay(args: argparse.Namespace) -> int:
    file = RecordedFile(args.file, args.speed)
    changes = {"session": args.session, "recording": args.recording}
    file.hello = file.hello.model_copy(update={name: value for name, value in changes.items() if value is not None})
    print(replay(file, args.server))
    return 0


def _mrider(args: argparse.Namespace) -> int:
    try:
        lines = args.file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BridgeError(f"cannot read {args.file}: {error}") from error
    recording = read_mrider(lines, args.recording, args.frames == "transposed", args.nodes)
    sys.stdout.writelines(f"{line}\n" for line in recording)
    return 0


_node_numbers = checked(lambda text: [int(n) for n in text.split(",")], "whole numbers separated by commas")
