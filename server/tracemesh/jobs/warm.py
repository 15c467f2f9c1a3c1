"""Networks made ready, kept between previews: while a slider moves, only what depends on it is solved again.

They live in the process that solves previews, and nowhere else.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from tracemesh.geometry.curves.closed_curves import begun_at_nodes
from tracemesh.geometry.curves.measured_scan import MeasuredScan
from tracemesh.geometry.curves.reconstruction import NetworkParameters, NetworkReconstruction, wanted_weights
from tracemesh.geometry.scan import Scan
from tracemesh.jobs.attached import SolvedNetwork, solved_network
from tracemesh.jobs.numbering import numbered
from tracemesh.pipeline import network_parameters
from tracemesh.wire.resources import ReconstructionParameters

FACTORS = 2
"""Bytes of a network made ready, factorisations included, for each byte of its arrays."""
Key = tuple[str, NetworkParameters]


def solve_warm(
    loaded: str, scan: Scan, indices: Sequence[int], parameters: ReconstructionParameters, budget: int
) -> SolvedNetwork:
    """The network of a scan as it was sent, known as `loaded`, whose curves have these indices in the session.

    Raises ScanError.
    """
    chosen = network_parameters(parameters)
    made_ready = replace(chosen, stretch=None, bend=None, weights="auto")
    begun = begun_at_nodes(scan)
    with numbered(indices):
        result = _kept().get((loaded, made_ready), begun, budget).solve(wanted_weights(chosen))
    return solved_network(scan, begun, indices, result)


class WarmNetworks:
    """Those used last, as far as they fit into a budget of bytes; always the very last one."""

    def __init__(self) -> None:
        """None yet."""
        self._networks: OrderedDict[Key, tuple[NetworkReconstruction, int]] = OrderedDict()

    def __len__(self) -> int:
        """How many are kept."""
        return len(self._networks)

    def get(self, key: Key, scan: Scan, budget: int) -> NetworkReconstruction:
        """The network of this key, made ready from the scan if it is not kept; raises ScanError."""
        if key not in self._networks:
            made = NetworkReconstruction(self._measured(key[0]) or scan, key[1])
            self._networks[key] = made, FACTORS * bytes_of(made)
        self._networks.move_to_end(key)
        while len(self._networks) > 1 and sum(size for _, size in self._networks.values()) > budget:
            self._networks.popitem(last=False)
        return self._networks[key][0]

    def _measured(self, loaded: str) -> MeasuredScan | None:
        """That of a network which was made of the same scan with other parameters."""
        return next((made.measured for (name, _), (made, _) in self._networks.items() if name == loaded), None)


@cache
def _kept() -> WarmNetworks:
    return WarmNetworks()


def bytes_of(thing: object) -> int:
    """Bytes of all arrays that hang on a thing, each counted once."""
    seen: set[int] = set()
    total, left = 0, [thing]
    while left:
        one = left.pop()
        if id(one) in seen or isinstance(one, type):
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            total += one.nbytes if one.base is None else 0
            left.append(one.base)
        elif isinstance(one, dict):
            left += one.values()
        elif isinstance(one, list | tuple):
            left += one
        else:
            left += getattr(one, "__dict__", {}).values()
    return total
