"""Every exception that the bridge raises on purpose.

    TracemeshError
└── BridgeError
    ├── FrameError        bytes that are no frame of the device
    ├── OperatorMistake   a key that makes no sense now: says which would
    ├── SpoolError        a spool that cannot be used as it is
    └── Refused           the server does not want this recording, and asking again will not change that
"""

from tracemesh.errors import TracemeshError


class BridgeError(TracemeshError):
    """Base of the bridge's errors; the message is meant for the person beside the device."""


class FrameError(BridgeError):
    """Bytes that are no frame of the device."""


class OperatorMistake(BridgeError):  # noqa: N818 - nothing is broken
    """A key that makes no sense now; the message says which would."""


class SpoolError(BridgeError):
    """A spool that cannot be used as it is; the message names the file and what was found."""


class Refused(BridgeError):  # noqa: N818 - the protocol's word
    """The server does not want this recording, and asking again will not change that."""
