"""What runs beside the server on a local network: plain HTTP with help, and the renewal of the certificate."""

import logging
import ssl
import threading
from collections.abc import Callable

import uvicorn

from tracemesh.api.lan.addresses import addresses, host_names
from tracemesh.api.lan.authority import Authority
from tracemesh.api.lan.plain import plain_app
from tracemesh.api.limits import PatientHttp
from tracemesh.settings import Settings

LOOK = 60.0
"""s between two looks whether addresses have changed or the certificate runs out."""
log = logging.getLogger(__name__)


def names() -> list[str]:
    """All that others may call this machine, the best first."""
    return [*addresses(), *host_names()]


class Lan:
    """The authority, and the threads that serve plain HTTP and renew the certificate until it is closed."""

    def __init__(self, settings: Settings) -> None:
        """Nothing runs yet."""
        self.authority = Authority(settings.data_dir / "tls", names())
        self.certificate, self.key = self.authority.certify(names())
        self._host = settings.listen_host
        self._wanted_port = settings.port + 1 if 0 < settings.port < 65535 else 0
        self._closing = threading.Event()
        self._threads: list[threading.Thread] = []
        self._server: uvicorn.Server | None = None

    def open(self, context: ssl.SSLContext, port: int) -> int | None:
        """Begin, beside HTTPS at `port` with this context; port of plain HTTP, None when it cannot be had."""
        configuration = uvicorn.Config(
            plain_app(self.authority, names, port),
            host=self._host,
            port=self._wanted_port,
            http=PatientHttp,
            limit_concurrency=100,
            access_log=False,
            log_config=None,
            server_header=False,
        )
        self._server = uvicorn.Server(configuration)
        self._run(self._serve)
        self._run(lambda: self._renew(context))
        while not self._server.started and self._threads[0].is_alive():
            self._closing.wait(0.01)
        if not self._server.started:
            return None
        return int(self._server.servers[0].sockets[0].getsockname()[1])

    def close(self) -> None:
        """End both."""
        self._closing.set()
        if self._server is not None:
            self._server.should_exit = True
        for thread in self._threads:
            thread.join()

    def _run(self, work: Callable[[], None]) -> None:
        self._threads.append(threading.Thread(target=work, name="lan"))
        self._threads[-1].start()

    def _serve(self) -> None:
        assert self._server is not None
        try:
            self._server.run()
        except SystemExit:  # uvicorn's word for an address that it could not have
            log.warning("no plain HTTP: port %d cannot be had", self._wanted_port)

    def _renew(self, context: ssl.SSLContext) -> None:
        """New connections get the new certificate; those that are open go on."""
        while not self._closing.wait(LOOK):
            try:
                context.load_cert_chain(*self.authority.certify(names()))
            except OSError as error:
                log.warning("the certificate could not be renewed: %s", error)
