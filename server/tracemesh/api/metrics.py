"""What an operator watches, in the form that Prometheus reads."""

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

COMMIT_BUCKETS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 5.0)
"""s; a device that waits longer than 0.1 s for its acknowledgement notices."""


class Metrics:
    """Counters and gauges of one application."""

    def __init__(self) -> None:
        """Everything at zero."""
        own = self.registry = CollectorRegistry()
        self.messages = Counter("tracemesh_messages", "Messages of devices committed", registry=own)
        self.bytes = Counter("tracemesh_message_bytes", "Bytes of messages committed", registry=own)
        self.refusals = Counter("tracemesh_refusals", "Devices refused, by the protocol's code", ["code"], registry=own)
        self.commits = Histogram(
            "tracemesh_commit_seconds", "Until a group of messages is durable", registry=own, buckets=COMMIT_BUCKETS
        )

    def watch(self, name: str, description: str, read: Callable[[], float]) -> None:
        """A number that is read whenever somebody asks."""
        Gauge(f"tracemesh_{name}", description, registry=self.registry).set_function(read)

    def text(self) -> bytes:
        """Everything, as text."""
        return generate_latest(self.registry)
