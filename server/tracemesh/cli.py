"""The command line: arguments in, files out. Messages go to stderr, data to stdout.

Exit status: 0 done; 1 the input cannot be reconstructed (says why and where); 2 usage.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
from collections.abc import Callable, Sequence
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from tracemesh.errors import InputError, TracemeshError
from tracemesh.files import check_writable, read_bytes, read_text, write_all
from tracemesh.terminal import ProgressLine
from tracemesh.wire.resources import ReconstructionParameters

if TYPE_CHECKING:
    from tracemesh.geometry.nodes.node_inference import InferredNodes
    from tracemesh.geometry.sensing.orientation import ReferenceField
    from tracemesh.pipeline import Reconstruction

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

T = TypeVar("T")
Number = TypeVar("Number", int, float)
MESH_FORMATS = ("glb", "obj", "ply", "stl")


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of `tracemesh`; never returns."""
    parser = build_parser()
    chosen = parser.parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = chosen.command
    try:
        status = command(chosen)
    except (TracemeshError, OSError) as error:
        print(f"tracemesh: {error}", file=sys.stderr)
        status = 1
    except argparse.ArgumentTypeError as error:
        parser.error(str(error))
    except ValidationError as error:
        parser.error("; ".join(map(_in_words, error.errors())))
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)


def _in_words(fault: ErrorDetails) -> str:
    where = ".".join(map(str, fault["loc"]))
    return f"{where + ': ' if where else ''}{fault['msg'].removeprefix('Value error, ')}"


def build_parser() -> argparse.ArgumentParser:
    """The whole grammar; docs/cli.md names every option of it."""
    parser = argparse.ArgumentParser(
        prog="tracemesh",
        description="Curve networks and surfaces from orientations measured along curves.",
        epilog="First steps:  tracemesh demo   |   tracemesh simulate leaf -o leaf.rawnet && "
        "tracemesh reconstruct leaf.rawnet -o leaf.glb",
    )
    parser.add_argument("--version", action="version", version=f"tracemesh {version('tracemesh')}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for add in (_add_reconstruct, _add_surface, _add_evaluate, _add_simulate, _add_serve, _add_demo):
        add(commands)
    return parser


def _add_reconstruct(commands: Commands) -> None:
    parser = commands.add_parser(
        "reconstruct",
        help="scan -> curve network -> surface",
        description="Reconstruct the curve network and the surface of a scan. All lengths in metres.",
    )
    parser.add_argument("input", metavar="INPUT", help="a rawnet or a recording; - reads standard input")
    _add_mesh_output(parser)
    parser.add_argument("--network", type=Path, metavar="NET.json", help="also write the curve network")
    parser.add_argument("--report", type=Path, metavar="REPORT.json", help="also write times, sizes, quality, warnings")
    parser.add_argument(
        "--step", type=_step, default="1.6%", help="distance of points: %% of the diagonal, or m (default 1.6%%)"
    )
    parser.add_argument("--stretch", type=float, metavar="L2", help="smoothing length of the stretch term, m (auto)")
    parser.add_argument("--bend", type=float, metavar="L4", help="smoothing length of the bend term, m (auto)")
    parser.add_argument("--weights", choices=("auto", "thesis"), default="auto", help="smoothing (default auto)")
    parser.add_argument(
        "--curve-bias", choices=("auto", "on", "off"), default="auto", help="fit heading and scale per curve (auto)"
    )
    parser.add_argument(
        "--length",
        type=_length,
        action="append",
        default=[],
        metavar="CURVE:SEGMENT=M",
        help="length of a segment that you measured, both counted from 1; may be repeated",
    )
    field = parser.add_mutually_exclusive_group()
    field.add_argument(
        "--place", type=_place, metavar="LAT,LON", help="degrees; the magnetic field there (--place=-33.9,151.2)"
    )
    field.add_argument(
        "--still", metavar="STILL.ndjson", help="the field that a recording of the device at rest measured"
    )
    parser.add_argument("--date", type=_date, metavar="YYYY-MM-DD", help="of the scan, with --place (default today)")
    parser.add_argument("--infer-nodes", action="store_true", help="find the nodes that are not marked")
    parser.add_argument("--soft", action="store_true", help="let the surface leave a noisy network a little")
    parser.add_argument("--no-surface", action="store_true", help="stop after the network; MESH is then not written")
    parser.set_defaults(command=_reconstruct)


def _add_surface(commands: Commands) -> None:
    parser = commands.add_parser(
        "surface", help="curve network -> surface", description="Span a smooth surface over a curve network."
    )
    parser.add_argument("input", metavar="NET.json", help="a network JSON; - reads standard input")
    _add_mesh_output(parser)
    parser.add_argument("--report", type=Path, metavar="REPORT.json", help="also write times, sizes, quality, warnings")
    parser.add_argument(
        "--resample",
        type=float,
        metavar="STEP",
        help="first space the points of every curve evenly, about STEP m apart",
    )
    parser.set_defaults(command=_surface)


def _add_mesh_output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        "--output",
        type=_mesh_path,
        required=True,
        metavar="MESH",
        help="mesh to write; the extension chooses: .glb (y up, as glTF demands), .obj .ply .stl (z up)",
    )


def _add_evaluate(commands: Commands) -> None:
    parser = commands.add_parser(
        "evaluate",
        help="distance of a mesh or network to the truth",
        description="Measure how far a mesh, or the points of a network, are from a true mesh.",
    )
    parser.add_argument("input", metavar="MESH", help="a mesh, or a network JSON (its points)")
    parser.add_argument("--truth", required=True, metavar="TRUTH", help="the true mesh")
    parser.add_argument(
        "--align",
        choices=("none", "rigid", "similarity"),
        default="none",
        help="register first: rotation and translation (rigid), also scale (similarity)",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(command=_evaluate)


def _add_simulate(commands: Commands) -> None:
    from tracemesh.geometry.simulated.shapes import SHAPES

    parser = commands.add_parser(
        "simulate",
        help="scan a built-in shape",
        description="Write the scan that a Morphorider would make of a built-in shape, with its truth.",
    )
    parser.add_argument("shape", metavar="SHAPE", choices=sorted(SHAPES), help=", ".join(sorted(SHAPES)))
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="SCAN.rawnet")
    parser.add_argument("--truth", type=Path, metavar="TRUTH.obj", help="also write the true mesh")
    parser.add_argument("--recording", type=Path, metavar="SCAN.ndjson", help="also write what the device sends")
    parser.add_argument(
        "--noise",
        type=_noise,
        default=0.015,
        help="of a unit vector, per axis; outliers, headings and marks go with it (default 0.015; 0: an exact device)",
    )
    parser.add_argument("--seed", type=_seed, default=0, help="of the noise (default 0)")
    parser.set_defaults(command=_simulate)


def _add_serve(commands: Commands) -> None:
    parser = commands.add_parser(
        "serve",
        help="run the server",
        description="Serve sessions, live view, reconstruction jobs and the web page. Settings: docs/settings.md.",
    )
    parser.add_argument("--host", help="address to listen on (default 127.0.0.1; any other demands a token)")
    parser.add_argument("--port", type=_port, help="port to listen on (default 8000)")
    parser.add_argument("--data-dir", type=Path, metavar="DIR", help="where sessions and meshes are kept")
    parser.set_defaults(command=_serve)


def _add_demo(commands: Commands) -> None:
    parser = commands.add_parser(
        "demo",
        help="watch a virtual Morphorider scan a shape",
        description="Start a server and a virtual Morphorider; open the printed address to watch curves grow, become a "
        "network, become a surface.",
    )
    parser.add_argument("--headless", action="store_true", help="no browser: do the same work, write files, exit")
    parser.add_argument("--out", type=Path, metavar="DIR", help="with --headless: network.json, mesh.glb, report.json")
    parser.add_argument("--port", type=_port, default=8000, help="port of the server (default 8000; 0: a free one)")
    parser.set_defaults(command=_demo)


def _mesh_path(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower().lstrip(".") not in MESH_FORMATS:
        wanted = ", ".join(f".{e}" for e in MESH_FORMATS)
        raise argparse.ArgumentTypeError(f"wanted a file name that ends in {wanted}, got {text!r}")
    return path


def _checked(check: Callable[[str], T], wanted: str) -> Callable[[str], T]:
    """A type for argparse that says what was wanted when `check` raises ValueError."""

    def convert(text: str) -> T:
        try:
            return check(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"wanted {wanted}, got {text!r}") from None

    return convert


def _two_numbers(text: str) -> tuple[float, float]:
    latitude, longitude = text.split(",")
    return float(latitude), float(longitude)


def _measured_length(text: str) -> tuple[tuple[int, int], float]:
    segment, metres = text.split("=")
    curve, place = segment.split(":")
    return (_between(int(curve), 1) - 1, _between(int(place), 1) - 1), float(metres)


def _between(number: Number, least: float, most: float = math.inf) -> Number:
    if not least <= number <= most:
        raise ValueError(number)
    return number


_step = _checked(
    lambda text: ReconstructionParameters(step=text).step, "a percentage such as 1.6% or metres such as 0.01"
)
_place = _checked(_two_numbers, "latitude and longitude in degrees, such as 45.2,5.7")
_length = _checked(_measured_length, "CURVE:SEGMENT=METRES, both counted from 1, such as 1:2=0.35")
_date = _checked(date.fromisoformat, "a date such as 2026-11-22")
_noise = _checked(lambda text: _between(float(text), 0.0, 1.0), "a number from 0 to 1")
_seed = _checked(lambda text: _between(int(text), 0), "a whole number from 0 up")
_port = _checked(lambda text: _between(int(text), 0, 65535), "a port from 0 to 65535")


def _reconstruct(chosen: argparse.Namespace) -> int:
    from tracemesh.formats.scans import read_scan
    from tracemesh.pipeline import reconstruct

    parameters = ReconstructionParameters(
        step=chosen.step,
        stretch=chosen.stretch,
        bend=chosen.bend,
        weights=chosen.weights,
        curve_bias=chosen.curve_bias,
        infer_nodes=chosen.infer_nodes,
        soft=chosen.soft,
        surface=not chosen.no_surface,
    )
    check_writable(chosen.output, chosen.network, chosen.report)
    scan = read_scan(read_text(chosen.input), chosen.input, _field(chosen))
    with ProgressLine() as progress:
        result = reconstruct(scan, parameters, progress, dict(chosen.length))
    if result.nodes:
        print(f"tracemesh: {_nodes_in_words(result.nodes)}", file=sys.stderr)
    _write_results(chosen, result)
    return 0


def _field(chosen: argparse.Namespace) -> ReferenceField | None:
    """The magnetic field that the person names, if any."""
    from tracemesh.formats.recordings import read_recording
    from tracemesh.formats.references import measured_reference
    from tracemesh.geometry.sensing.magnetic_field import field_at

    if chosen.date and not chosen.place:
        raise InputError("--date says when the field of a --place is wanted, but there is no --place")
    if chosen.place:
        latitude, longitude = chosen.place
        return field_at(latitude, longitude, chosen.date or date.today())
    if chosen.still:
        return measured_reference(read_recording(read_text(chosen.still).split("\n"), chosen.still))
    return None


def _nodes_in_words(nodes: InferredNodes) -> str:
    from tracemesh.pipeline import LEAST_CONFIDENCE, is_used

    used = [p for p in nodes.proposals if is_used(p)]
    marked = sum(p.node is not None for p in used)
    unlikely = len(nodes.proposals) - len(used)
    least = min((p.confidence for p in used), default=0.0)
    rest = f"; {unlikely} left out, being no likelier than {LEAST_CONFIDENCE}" if unlikely else ""
    found = f"{len(used) - marked} found with a confidence of at least {least:.2f}"
    return f"{len(used)} nodes, {marked} of them marked, {found}{rest}"


def _surface(chosen: argparse.Namespace) -> int:
    from tracemesh.formats.networks import read_network
    from tracemesh.pipeline import span

    check_writable(chosen.output, chosen.report)
    network = read_network(read_text(chosen.input), chosen.input)
    with ProgressLine() as progress:
        result = span(network, progress, chosen.resample)
    _write_results(chosen, result)
    return 0


def _write_results(chosen: argparse.Namespace, result: Reconstruction) -> None:
    for warning in result.warnings:
        print(f"tracemesh: warning: {warning}", file=sys.stderr)
    outputs: dict[Path, bytes] = {}
    if result.mesh is not None:
        outputs[chosen.output] = result.mesh_file(chosen.output.suffix.lower().lstrip("."))
    if "network" in chosen and chosen.network:
        outputs[chosen.network] = result.network_file()
    if chosen.report:
        outputs[chosen.report] = result.report_file()
    write_all(outputs)


def _evaluate(chosen: argparse.Namespace) -> int:
    from tracemesh.formats.meshes import read_mesh
    from tracemesh.formats.networks import read_network
    from tracemesh.geometry.comparison.evaluation import evaluate, vertex_normals

    truth = read_mesh(read_bytes(chosen.truth), Path(chosen.truth).suffix.lstrip("."), chosen.truth)
    if Path(chosen.input).suffix == ".json":
        network = read_network(read_text(chosen.input), chosen.input)
        measured = evaluate(network.points, network.normals, *truth, align=chosen.align)
    else:
        vertices, faces = read_mesh(read_bytes(chosen.input), Path(chosen.input).suffix.lstrip("."), chosen.input)
        measured = evaluate(vertices, vertex_normals(vertices, faces), *truth, align=chosen.align)
    print(json.dumps(measured.summary()) if chosen.json else measured.text())
    return 0


def _simulate(chosen: argparse.Namespace) -> int:
    from tracemesh.formats.meshes import write_triangles
    from tracemesh.formats.rawnet import write_rawnet
    from tracemesh.formats.recordings import recording_from_simulation, scan_from_recordings, write_recording
    from tracemesh.geometry.simulated.shapes import SHAPES
    from tracemesh.geometry.simulated.simulation import Imperfections, plan_scan, simulate_scan

    check_writable(chosen.output, chosen.truth, chosen.recording)
    shape = SHAPES[chosen.shape]()
    imperfections = Imperfections().scaled(chosen.noise / Imperfections.vector)
    simulated = simulate_scan(plan_scan(shape, imperfections=imperfections, seed=chosen.seed), chosen.seed)
    recording = recording_from_simulation(simulated, f"{chosen.shape}-{chosen.seed}")
    outputs = {chosen.output: write_rawnet(scan_from_recordings([recording])).encode()}
    if chosen.recording:
        outputs[chosen.recording] = write_recording(recording).encode()
    if chosen.truth:
        outputs[chosen.truth] = write_triangles(*shape.mesh(), chosen.truth.suffix.lower().lstrip("."))
    write_all(outputs)
    return 0


def _serve(chosen: argparse.Namespace) -> int:
    from tracemesh.api.server import serve
    from tracemesh.settings import Settings

    given = {"host": chosen.host, "port": chosen.port, "data_dir": chosen.data_dir}
    serve(Settings(**{name: value for name, value in given.items() if value is not None}))
    return 0


def _demo(chosen: argparse.Namespace) -> int:
    from tracemesh.demo import headless, watch

    if chosen.headless != (chosen.out is not None):
        raise argparse.ArgumentTypeError("--headless and --out DIR need each other")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the demo's own processes end with it
    if chosen.headless:
        return headless(chosen.out, chosen.port)
    return watch(chosen.port)
