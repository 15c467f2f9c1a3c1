"""Commands for recordings in files."""

import argparse
from pathlib import Path

from tracemesh_bridge.commands.options import Commands, add_command, add_server, identifier, positive
from tracemesh_bridge.replay import RecordedFile, replay


def add(commands: Commands) -> None:
    """Add `replay`."""
    command = add_command(commands, "replay", "send a recording that lies in a file", _replay)
    add_server(command)
    option = command.add_argument
    option("file", type=Path, help="recording: newline-delimited JSON that begins with hello")
    option("--session", type=identifier, help="into this session (default: the one it was recorded into)")
    option("--recording", type=identifier, help="as another recording, if the server has it already")
    option("--speed", type=positive, help="times faster than it was recorded (default: at once)")


def _replay(args: argparse.Namespace) -> int:
    file = RecordedFile(args.file, args.speed)
    changes = {"session": args.session, "recording": args.recording}
    file.hello = file.hello.model_copy(update={name: value for name, value in changes.items() if value is not None})
    print(replay(file, args.server))
    return 0
