"""What is measured on: data with known truth beside the checkout, and the built-in shapes."""

from dataclasses import dataclass
from pathlib import Path

from tracemesh.formats.networks import read_network
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.formats.recordings import recording_from_simulation, scan_from_recordings
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.simulated.shapes import SHAPES, Shape
from tracemesh.geometry.simulated.simulation import plan_scan, simulate_scan

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared" / "data"

TRUTH_STEP = 1e-3  # of the diagonal, between the points of a built-in shape's exact network


@dataclass(frozen=True)
class KnownScan:
    """A scan, the exact network that it ought to become, and its bounding box's diagonal, m."""

    name: str
    scan: Scan
    truth: CurveNetwork

    @property
    def diagonal(self) -> float:
        return self.truth.diagonal


@dataclass(frozen=True)
class Data:
    """folder: of data with known truth, or None; without it only the built-in shapes are measured."""

    folder: Path | None

    @classmethod
    def beside_checkout(cls) -> "Data":
        return cls(SHARED if SHARED.is_dir() else None)

    def scans(self, kind: str) -> list[KnownScan]:
        """The folder's scans; kind: exact or noisy."""
        if self.folder is None:
            return []
        paths = sorted((self.folder / "scans").glob(f"*-{kind}.rawnet"))
        return [self.scan(path.name.removesuffix(f"-{kind}.rawnet"), kind) for path in paths]

    def scan(self, name: str, kind: str) -> KnownScan:
        """One scan of the folder, by name."""
        assert self.folder is not None
        scan = read_rawnet((self.folder / "scans" / f"{name}-{kind}.rawnet").read_text(), name)
        truth = read_network((self.folder / "scans" / f"{name}.truth.network.json").read_text(), name)
        return KnownScan(f"{name}, {kind}", scan, truth)

    def networks(self) -> list[tuple[str, CurveNetwork]]:
        """The folder's exact networks with their names."""
        if self.folder is None:
            return []
        paths = sorted((self.folder / "networks").glob("*.network.json"))
        return [(path.name.removesuffix(".network.json"), read_network(path.read_text(), path.name)) for path in paths]


def built_in(name: str) -> Shape:
    return SHAPES[name]()


def exact_network(shape: Shape) -> CurveNetwork:
    """The shape's own network, finely sampled."""
    return shape.network(TRUTH_STEP * shape.network(0.05).diagonal)


def noisy_scan(name: str, seed: int = 1) -> KnownScan:
    """A simulated Morphorider's scan of a built-in shape, with its imperfections."""
    shape = built_in(name)
    simulated = simulate_scan(plan_scan(shape, seed=seed), seed)
    scan = scan_from_recordings([recording_from_simulation(simulated, f"{name}-{seed}")])
    return KnownScan(f"{name} (built in), noisy", scan, exact_network(shape))
