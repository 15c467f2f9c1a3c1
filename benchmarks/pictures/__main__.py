"""`python -m benchmarks.pictures [NAME ...]`: draw docs/pictures/algorithms/NAME.png, all when none is named."""

import argparse
import sys
from collections.abc import Callable

from matplotlib.figure import Figure

from benchmarks.data import ROOT
from benchmarks.pictures import arrays, curves, devices, surfaces
from benchmarks.pictures.canvas import save

FOLDER = ROOT / "docs" / "pictures" / "algorithms"

PICTURES: dict[str, Callable[[], Figure]] = {
    "orientation": curves.orientation,
    "fusion": devices.fusion,
    "magnetic_field": devices.magnetic_field,
    "calibration": devices.calibration,
    "wheel_offset": devices.wheel_offset,
    "sketch": devices.sketch,
    "array_network": arrays.array_network,
    "cleaning": curves.cleaning,
    "resampling": curves.resampling,
    "regression": curves.regression,
    "weights": curves.weights,
    "reconstruction": curves.reconstruction,
    "positions": curves.positions,
    "bias": curves.bias,
    "uncertainty": curves.uncertainty,
    "spline_network": surfaces.spline_network,
    "node_inference": curves.node_inference,
    "cycles": surfaces.cycles,
    "patches": surfaces.patches,
    "several_loops": surfaces.several_loops,
    "surface": surfaces.surface,
    "curvature": surfaces.curvature,
    "refinement": surfaces.refinement,
    "evaluation": surfaces.evaluation,
    "simulation": curves.simulation,
}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of {', '.join(PICTURES)}")
    chosen = parser.parse_args(arguments).names or list(PICTURES)
    if unknown := sorted(set(chosen) - set(PICTURES)):
        parser.error(f"no picture {', '.join(unknown)}: there are {', '.join(PICTURES)}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        save(PICTURES[name](), FOLDER / f"{name}.png")
        print(FOLDER / f"{name}.png")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
