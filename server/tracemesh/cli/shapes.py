"""`tracemesh simulate` makes scans with known truth, `tracemesh evaluate` measures how far a result is from it."""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tracemesh.cli.arguments import Commands, noise, seed
from tracemesh.errors import InputError
from tracemesh.files import check_writable, read_bytes, read_text, write_all

if TYPE_CHECKING:
    from tracemesh.geometry.comparison.evaluation import Evaluation
    from tracemesh.geometry.network import Floats, Ints


def add_evaluate(commands: Commands) -> None:
    """Result against truth."""
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
    parser.add_argument(
        "--both-ways",
        action="store_true",
        help="of a mesh: also from the truth to it; prints the Hausdorff distance, large where a part is missing",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(command=_evaluate)


def add_simulate(commands: Commands) -> None:
    """A scan whose truth is known."""
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
        type=noise,
        default=0.015,
        help="of a unit vector, per axis; outliers, headings and marks go with it (default 0.015; 0: an exact device)",
    )
    parser.add_argument("--seed", type=seed, default=0, help="of the noise (default 0)")
    parser.set_defaults(command=_simulate)


def _evaluate(chosen: argparse.Namespace) -> int:
    from tracemesh.formats.networks import read_network
    from tracemesh.geometry.comparison.evaluation import evaluate

    truth = _mesh(chosen.truth)
    if Path(chosen.input).suffix != ".json":
        measured = _evaluated_mesh(_mesh(chosen.input), truth, chosen)
    elif chosen.both_ways:
        raise InputError(f"{chosen.input}: wanted a mesh to look at both ways, got a network: it has no surface")
    else:
        network = read_network(read_text(chosen.input), chosen.input)
        measured = evaluate(network.points, network.normals, *truth, align=chosen.align)
    print(json.dumps(measured.summary()) if chosen.json else measured.text())
    return 0


def _mesh(path: str) -> "tuple[Floats, Ints]":
    from tracemesh.formats.meshes import read_mesh

    return read_mesh(read_bytes(path), Path(path).suffix.lstrip("."), path)


def _evaluated_mesh(
    mesh: "tuple[Floats, Ints]", truth: "tuple[Floats, Ints]", chosen: argparse.Namespace
) -> "Evaluation":
    from tracemesh.geometry.comparison.evaluation import evaluate, hausdorff_distance, vertex_normals

    vertices, faces = mesh
    measured = evaluate(vertices, vertex_normals(vertices, faces), *truth, align=chosen.align)
    if not chosen.both_ways:
        return measured
    distance = hausdorff_distance(measured.placement.apply(vertices), faces, *truth)
    return replace(measured, hausdorff=100 * distance / measured.diagonal)


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
