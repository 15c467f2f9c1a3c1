"""A smooth surface spanned over a curve network: interpolates its points and normals (thesis chapter 4)."""

from tracemesh.geometry.network import CurveNetwork
from tracemesh.geometry.surfaces.surface_stages import (
    Progress,
    Stages,
    SurfaceParameters,
    SurfaceResult,
    finished,
    prepared,
)
from tracemesh.geometry.surfaces.whole_surface import whole_surface

__all__ = ["Progress", "SurfaceParameters", "SurfaceResult", "span_surface"]


def span_surface(
    network: CurveNetwork, parameters: SurfaceParameters | None = None, progress: Progress | None = None
) -> SurfaceResult:
    """Span a surface over a network.

    progress(stage, fraction) is called between stages and may raise Cancelled. Raises NetworkError if the curves do not
    form a cell complex and SurfaceError if a patch cannot be meshed; both name the segment.
    """
    parameters, stages = parameters or SurfaceParameters(), Stages(progress)
    complex_ = prepared(network, parameters, stages)
    return finished(complex_, *whole_surface(complex_, parameters, stages), stages)
