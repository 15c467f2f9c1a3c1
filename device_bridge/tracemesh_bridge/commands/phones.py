"""Commands that record a phone."""

import argparse

from tracemesh_bridge.commands.options import Commands, Run, add_recording_command, device, port_number, target
from tracemesh_bridge.phone import MOUNTING
from tracemesh_bridge.record import record
from tracemesh_bridge.sources.phyphox import Phyphox
from tracemesh_bridge.sources.sensorlogger import SensorLogger
from tracemesh_bridge.sources.sensorserver import SensorServer, SensorServerSettings


def add(commands: Commands) -> None:
    """Add `sensorserver`, `sensorlogger` and `phyphox`."""
    command = _add(commands, "sensorserver", "record an Android phone that runs SensorServer", _sensorserver)
    command.add_argument("--address", required=True, help="host:port as the app shows it")
    command.add_argument(
        "--sensors", nargs="+", default=SensorServerSettings.sensors, metavar="SENSOR",
        help=f"Android names without android.sensor. (default: {' '.join(SensorServerSettings.sensors)})",
    )  # fmt: skip
    command = _add(commands, "sensorlogger", "record a phone that runs Sensor Logger", _sensorlogger)
    command.add_argument("--host", default="0.0.0.0", help="address to listen at (default: %(default)s, any)")
    command.add_argument("--port", type=port_number, default=8200, help="port to listen at (default %(default)d)")
    command = _add(commands, "phyphox", "record a phone that runs phyphox", _phyphox)
    command.add_argument("--address", required=True, help="as the app shows it, such as http://192.168.0.7:8080")


def _add(commands: Commands, name: str, words: str, run: Run) -> argparse.ArgumentParser:
    command = add_recording_command(commands, name, words, run)
    command.set_defaults(mounting=MOUNTING)
    return command


def _sensorserver(args: argparse.Namespace) -> int:
    settings, phone = SensorServerSettings(args.address, tuple(args.sensors)), device(args, "sensorserver")
    return not record(target(args), phone, lambda host: SensorServer(settings, phone, host))


def _sensorlogger(args: argparse.Namespace) -> int:
    phone = device(args, "sensorlogger")
    return not record(target(args), phone, lambda host: SensorLogger((args.host, args.port), phone, host))


def _phyphox(args: argparse.Namespace) -> int:
    phone = device(args, "phyphox")
    return not record(target(args), phone, lambda host: Phyphox(args.address, phone, host))
