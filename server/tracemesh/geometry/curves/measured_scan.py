"""A scan as far as it does not matter how finely it will be cut: cleaned, placed, measured."""

from collections.abc import Sequence

import numpy as np

from tracemesh.errors import ScanError
from tracemesh.geometry.curves.cleaning import clean_curves
from tracemesh.geometry.curves.placement import PlacedCurve, known_nodes, measured_layout, place_curve
from tracemesh.geometry.curves.polyline import MeasuredNetwork, measure_network
from tracemesh.geometry.curves.positions import check_connected
from tracemesh.geometry.curves.sketch import with_lengths
from tracemesh.geometry.scan import Scan, curve_name

_OPEN_GAP = 0.2  # of its length that a closed curve may lack as measured; a half circle lacks 0.64


class MeasuredScan:
    """cleaned: the curves without outliers and duplicates. curves: these with their lengths and marks. indices: (c,)
    of each in the scan. known_nodes: (k,) numbers that the scan gave its nodes. network: of the measured samples.
    """

    def __init__(self, scan: Scan) -> None:
        """Clean and measure; raises ScanError naming the curve that prevents it, PiecesError what hangs on nothing."""
        if not scan.curves:
            raise ScanError("the scan holds no curve")
        self.cleaned = clean_curves(scan.curves)
        placed = tuple(place_curve(curve) for curve in self.cleaned)
        self.indices = np.array([c.index for c in placed])
        self.known_nodes = known_nodes(placed)
        check_connected(measured_layout(placed), self.indices)
        self.curves = with_lengths(placed)
        self.network = measure_network(self.curves, measured_layout(self.curves))
        _check_closed(self.curves, self.network)


def _check_closed(curves: Sequence[PlacedCurve], measured: MeasuredNetwork) -> None:
    """Raise ScanError for the first closed curve whose tangents do not lead back to its start."""
    for i, curve in enumerate(curves):
        missing = measured.displacement(i)
        if curve.closed and missing > _OPEN_GAP * curve.length:
            raise ScanError(
                f"{curve_name(curve.index)} is marked as closed, but ends {missing:.3g} m from where it began "
                f"({100 * missing / curve.length:.0f} % of its length)",
                (curve.index,),
                "open",
            )
