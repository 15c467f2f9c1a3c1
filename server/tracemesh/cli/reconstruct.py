"""`tracemesh reconstruct` and `tracemesh surface`: a file in, a mesh out."""

from __future__ import annotations

import argparse
import sys
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from tracemesh.cli.arguments import Commands, iso_date, length, mesh_path, mesh_size, place, seed, step
from tracemesh.errors import InputError
from tracemesh.files import check_writable, read_text, write_all
from tracemesh.terminal import ProgressLine
from tracemesh.wire.resources import ReconstructionParameters

if TYPE_CHECKING:
    from tracemesh.geometry.nodes.node_inference import InferredNodes
    from tracemesh.geometry.sensing.orientation import ReferenceField
    from tracemesh.pipeline import Reconstruction
    from tracemesh.wire.calibration import Calibration


def add_reconstruct(commands: Commands) -> None:
    """Scan to network and mesh."""
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
        "--step",
        type=step,
        default="1.6%",
        help="distance of points: %% of the estimated diagonal, or m (default 1.6%%)",
    )
    _add_mesh_size(parser)
    _add_smoothing(parser)
    parser.add_argument(
        "--length",
        type=length,
        action="append",
        default=[],
        metavar="CURVE:SEGMENT=M",
        help="length of a segment that you measured, both counted from 1; may be repeated",
    )
    _add_origin(parser)
    parser.add_argument(
        "--reading",
        type=seed,
        metavar="N",
        help="of a fixed array's recording: which reading, from 0 (default the last)",
    )
    parser.add_argument("--infer-nodes", action="store_true", help="find the nodes that are not marked")
    parser.add_argument("--soft", action="store_true", help="let the surface leave a noisy network a little")
    parser.add_argument("--no-surface", action="store_true", help="stop after the network; MESH is then not written")
    parser.set_defaults(command=_reconstruct)


def _add_smoothing(parser: argparse.ArgumentParser) -> None:
    """How noise and errors of whole curves are dealt with."""
    parser.add_argument(
        "--prefilter", type=float, metavar="SIGMA", help="width of the Gaussian while resampling, m (auto: half a step)"
    )
    parser.add_argument("--stretch", type=float, metavar="L2", help="smoothing length of the stretch term, m (auto)")
    parser.add_argument("--bend", type=float, metavar="L4", help="smoothing length of the bend term, m (auto)")
    parser.add_argument("--weights", choices=("auto", "thesis"), default="auto", help="smoothing (default auto)")
    parser.add_argument(
        "--curve-bias", choices=("auto", "on", "off"), default="auto", help="fit heading and scale per curve (auto)"
    )
    parser.add_argument("--robust", action="store_true", help="bear several percent of frames that are pure chance")


def _add_origin(parser: argparse.ArgumentParser) -> None:
    """Where readings come from: the field of the place, the device's own errors."""
    field = parser.add_mutually_exclusive_group()
    field.add_argument(
        "--place", type=place, metavar="LAT,LON", help="degrees; the magnetic field there (--place=-33.9,151.2)"
    )
    field.add_argument(
        "--still", metavar="STILL.ndjson", help="the field that a recording of the device at rest measured"
    )
    parser.add_argument("--date", type=iso_date, metavar="YYYY-MM-DD", help="of the scan, with --place (default today)")
    parser.add_argument(
        "--calibration", metavar="CAL.json", help="of the device, as tracemesh-bridge calibrate writes it"
    )


def add_surface(commands: Commands) -> None:
    """Network to mesh."""
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
    _add_mesh_size(parser)
    parser.set_defaults(command=_surface)


def _add_mesh_size(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--mesh-size",
        type=mesh_size,
        help="distance of the surface's vertices: %% of the estimated diagonal, or m (default: as its points)",
    )


def _add_mesh_output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        "--output",
        type=mesh_path,
        required=True,
        metavar="MESH",
        help="mesh to write; the extension chooses: .glb (y up, as glTF demands), .obj .ply .stl (z up)",
    )


def _reconstruct(chosen: argparse.Namespace) -> int:
    from tracemesh.formats.calibrations import read_calibration
    from tracemesh.formats.scans import read_scan
    from tracemesh.pipeline import reconstruct_measured

    parameters = ReconstructionParameters(
        step=chosen.step,
        mesh_size=chosen.mesh_size,
        prefilter=chosen.prefilter,
        stretch=chosen.stretch,
        bend=chosen.bend,
        weights=chosen.weights,
        curve_bias=chosen.curve_bias,
        robust=chosen.robust,
        infer_nodes=chosen.infer_nodes,
        soft=chosen.soft,
        surface=not chosen.no_surface,
        reading=chosen.reading,
    )
    check_writable(chosen.output, chosen.network, chosen.report)
    calibration = read_calibration(read_text(chosen.calibration), chosen.calibration) if chosen.calibration else None
    measured = read_scan(read_text(chosen.input), chosen.input, _field(chosen, calibration), calibration)
    with ProgressLine() as progress:
        result = reconstruct_measured(measured, parameters, progress, dict(chosen.length))
    if result.nodes:
        print(f"tracemesh: {_nodes_in_words(result.nodes)}", file=sys.stderr)
    _write_results(chosen, result)
    return 0


def _field(chosen: argparse.Namespace, calibration: Calibration | None) -> ReferenceField | None:
    """The magnetic field that the person names, if any; what a device at rest measured is calibrated, too."""
    from tracemesh.formats.recordings import read_recording
    from tracemesh.formats.references import measured_reference, with_calibration
    from tracemesh.geometry.sensing.magnetic_field import field_at

    if chosen.date and not chosen.place:
        raise InputError("--date says when the field of a --place is wanted, but there is no --place")
    if chosen.place:
        latitude, longitude = chosen.place
        return field_at(latitude, longitude, chosen.date or date.today())
    if chosen.still:
        still = read_recording(read_text(chosen.still).split("\n"), chosen.still)
        return measured_reference(with_calibration(still, calibration))
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
        result = span(network, progress, chosen.resample, ReconstructionParameters(mesh_size=chosen.mesh_size))
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
