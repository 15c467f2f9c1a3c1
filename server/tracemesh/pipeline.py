"""The whole way from a scan to a network and its surface: pure, reports its progress, can be stopped between stages."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from time import perf_counter

from tracemesh.formats.meshes import write_mesh
from tracemesh.formats.networks import write_network
from tracemesh.geometry.mesh import Mesh
from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.reconstruction import NetworkParameters, reconstruct_network
from tracemesh.geometry.scan import Scan
from tracemesh.geometry.surface import SurfaceParameters, span_surface
from tracemesh.wire.resources import ReconstructionParameters

Progress = Callable[[str, float], None]
"""Called with the stage in words and the fraction done (0 to 1); raises `Cancelled` to stop the work."""

NETWORK_SHARE = 0.3
"""Part of the whole work, as the progress bar shows it, that the network takes."""


@dataclass(frozen=True)
class Reconstruction:
    """What a reconstruction leaves: `mesh` is None when only the network was asked for; `report` is plain JSON."""

    network: CurveNetwork
    mesh: Mesh | None
    report: dict[str, object]

    def mesh_file(self, extension: str = "glb") -> bytes:
        """The mesh as a file of this extension; GLB also holds the network and where it all comes from."""
        if self.mesh is None:
            raise ValueError("wanted a reconstruction with a surface, got one of the network only")
        return write_mesh(self.mesh, extension, self.network, {"generator": self.report["generator"]})

    def network_file(self) -> bytes:
        """The curve network as network JSON."""
        return write_network(self.network).encode()

    def report_file(self) -> bytes:
        """Stage times (s), sizes, parameters used, residuals, quality and warnings as JSON."""
        return (json.dumps(self.report, indent=1) + "\n").encode()


def reconstruct(
    scan: Scan, parameters: ReconstructionParameters | None = None, progress: Progress | None = None
) -> Reconstruction:
    """Curve network of a scan and the surface that spans it.

    Raises ScanError or NetworkError when the scan cannot be reconstructed, SurfaceError when no valid mesh spans its
    network, and whatever `progress` raises.
    """
    parameters = parameters or ReconstructionParameters()
    report = progress or _silent
    begin = perf_counter()
    curves = reconstruct_network(scan, network_parameters(parameters), _part(report, 0.0, NETWORK_SHARE))
    result = Reconstruction(curves.network, None, {"generator": _generator(), "network": curves.report})
    if parameters.surface:
        result = _with_surface(result, SurfaceParameters(), _part(report, NETWORK_SHARE, 1.0))
    result.report["seconds"] = perf_counter() - begin
    report("done", 1.0)
    return result


def span(network: CurveNetwork, progress: Progress | None = None) -> Reconstruction:
    """Surface over a network that is known already; raises NetworkError or SurfaceError."""
    begin = perf_counter()
    result = _with_surface(
        Reconstruction(network, None, {"generator": _generator()}), SurfaceParameters(), progress or _silent
    )
    result.report["seconds"] = perf_counter() - begin
    return result


def network_parameters(parameters: ReconstructionParameters) -> NetworkParameters:
    """The kernel's parameters for what a person chose."""
    relative = parameters.step.endswith("%")
    number = float(parameters.step.rstrip("%"))
    return NetworkParameters(
        step=None if relative else number,
        step_fraction=number / 100 if relative else NetworkParameters.step_fraction,
        stretch=parameters.stretch,
        bend=parameters.bend,
        weights=parameters.weights,
        curve_bias=parameters.curve_bias,
    )


def _with_surface(before: Reconstruction, parameters: SurfaceParameters, progress: Progress) -> Reconstruction:
    spanned = span_surface(before.network, parameters, progress)
    return Reconstruction(before.network, spanned.mesh, {**before.report, "surface": spanned.report})


def _generator() -> str:
    return f"tracemesh {version('tracemesh')}"


def _part(progress: Progress, start: float, end: float) -> Progress:
    """The progress of a part as progress of the whole."""
    return lambda stage, fraction: progress(stage, start + (end - start) * fraction)


def _silent(stage: str, fraction: float) -> None:
    pass
