"""Messages about a scan, told with the numbers that people see beside their curves.

The kernel counts the curves that it is given; a session counts all that were scanned, also those removed since.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from tracemesh.errors import ScanError, SurfaceError
from tracemesh.geometry.scan import curve_name


def renumbered(message: str, indices: Sequence[int]) -> str:
    """A message about a scan whose curves (c,) have these indices in their session."""
    called = {curve_name(place): curve_name(index) for place, index in enumerate(indices)}
    known = "|".join(map(re.escape, called))
    return re.sub(rf"\b(?:{known})\b", lambda found: called.get(found[0], found[0]), message)


@contextmanager
def numbered(indices: Sequence[int]) -> Iterator[None]:
    """What is raised within about a scan says the session's numbers; its `curves` stay the scan's."""
    try:
        yield
    except (ScanError, SurfaceError) as error:
        error.args = (renumbered(str(error), indices),)
        raise
