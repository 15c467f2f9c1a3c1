"""Every exception that tracemesh raises on purpose.

TracemeshError
├── InputError            a file or message that cannot be read: says where, what was wanted, what came
├── ScanError             readable, but no network can be reconstructed from it: names the curve
│   ├── PiecesError       its curves do not hang together at nodes: names the pieces
│   └── NetworkError      the curves do not form the cell complex that a surface needs: names the segment
├── SurfaceError          no valid mesh can be spanned over a network
├── Cancelled             somebody asked for the work to stop
└── ResourceError         what a request to the service names or asks for cannot be had
    ├── NotFound
    ├── Conflict
    ├── Changed           it is not any more what the request says that it is
    ├── Unavailable       another service that is needed does not answer: asking again later may help
    │   └── ClusterAway   the scheduler of the cluster that runs jobs
    ├── Refused           a device's message that is not taken: carries the code that the protocol has for it
    └── Overtaken         another server on the same database was faster: says with which recordings
"""

from collections.abc import Mapping

MENDS = ("boundary", "interior", "open", "remove", "nodes")
"""What may be done to a curve: mark it as boundary, as interior or as open, leave it out, find its nodes."""


class TracemeshError(Exception):
    """Base of all errors whose message is meant for the person in front of the screen."""


class InputError(TracemeshError):
    """A file or message that cannot be read; the message says where, what was wanted and what came."""


class ScanError(TracemeshError):
    """A scan from which no network can be reconstructed; the message names the curve and the reason."""

    def __init__(self, message: str, curves: tuple[int, ...] = (), mend: str | None = None) -> None:
        """curves: those that it is about, counted from 0; mend: what would mend it, if that is one of MENDS."""
        super().__init__(message)
        self.curves = curves
        self.mend = mend


class PiecesError(ScanError):
    """A scan whose curves do not hang together at nodes; the message names the pieces."""


class NetworkError(ScanError):
    """Curves that do not form a cell complex; the message names the segment and what would mend it."""


class SurfaceError(TracemeshError):
    """A network over which no valid mesh can be spanned; the message names the patch."""


class Cancelled(TracemeshError):  # noqa: N818 - not a failure
    """Somebody asked for the work to stop."""


class ResourceError(TracemeshError):
    """What a request to the service names or asks for cannot be had."""


class NotFound(ResourceError):  # noqa: N818 - HTTP's own words
    """Nothing has this name."""


class Changed(ResourceError):  # noqa: N818 - no failure of the server
    """It is not any more what the request says that it is."""


class Conflict(ResourceError):  # noqa: N818 - HTTP's own words
    """The state of the resource does not allow it."""


class Unavailable(ResourceError):  # noqa: N818 - HTTP's own words
    """Another service that is needed does not answer, or answers wrongly; the message says which."""


class ClusterAway(Unavailable):
    """The scheduler of the cluster that runs jobs does not answer, or has no workers."""


class Refused(ResourceError):  # noqa: N818 - the protocol's own word
    """A device's message that the server does not take."""

    def __init__(self, code: str, message: str, expected_seq: int | None = None) -> None:
        """`code` as in wire.device.ErrorMessage; `expected_seq` with code "gap"."""
        super().__init__(message)
        self.code = code
        self.expected_seq = expected_seq


class Overtaken(ResourceError):  # noqa: N818 - nothing is broken
    """Another server on the same database goes on with some recordings of a group, so that it cannot be stored."""

    def __init__(self, reasons: Mapping[int, Refused]) -> None:
        """`reasons`: why not, by the recording's key."""
        super().__init__(f"another server was faster with {len(reasons)} recordings")
        self.reasons = reasons
