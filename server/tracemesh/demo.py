"""The whole product at once: a virtual Morphorider behind a real pseudo-terminal, the bridge, the server, a job.

Nothing here is special to the demo: the same commands that a lab runs are started as processes, and the shape, being
built in, tells how far the result is from the truth.
"""

import json
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from tracemesh.errors import TracemeshError
from tracemesh.files import write_all
from tracemesh.formats.networks import read_network
from tracemesh.geometry.comparison.evaluation import Evaluation, evaluate
from tracemesh.geometry.simulated.shapes import SHAPES
from tracemesh.terminal import ProgressLine

SHAPE = "leaf"
SPEED = 5.0
"""How many times faster than a hand the virtual device is moved."""
READINGS_PER_SECOND = 60.0
"""What a Morphorider over Bluetooth answers in the time of the hand."""
LARGEST_MEAN_ERROR = 1.0
"""% of the diagonal: the thesis's own figure."""
PATIENCE = 60.0
"""s, how long any single step may take before the demo gives up."""


@dataclass(frozen=True)
class Server:
    """A running server."""

    address: str

    def request(self, method: str, path: str, body: object = None) -> bytes:
        """Answer to a REST request under /api/v1; raises TracemeshError with the server's own words."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            f"http://{self.address}/api/v1{path}", data, {"Content-Type": "application/json"}, method=method
        )
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
                content: bytes = answer.read()
                return content
        except urllib.error.HTTPError as error:
            raise TracemeshError(f"{method} {path}: {error.read().decode(errors='replace')}") from None

    def json(self, method: str, path: str, body: object = None) -> Any:
        """The same, decoded."""
        return json.loads(self.request(method, path, body))


def watch(port: int) -> int:
    """Print the page's address, scan and reconstruct before the watcher's eyes, serve until interrupted."""
    with tempfile.TemporaryDirectory(prefix="tracemesh-demo-") as folder, _server(Path(folder), port) as server:
        session = _new_session(server)
        print(f"Open  http://{server.address}/#/sessions/{session}", flush=True)
        print(f"A virtual Morphorider now scans a {SHAPE}. Ctrl-C ends the demo.", file=sys.stderr)
        _scan(server, session, Path(folder))
        _reconstruct(server, session)
        print("The surface is there; the page stays until Ctrl-C.", file=sys.stderr)
        while True:
            time.sleep(3600)


def headless(out: Path, port: int) -> int:
    """Do the same without a browser and leave network.json, mesh.glb and report.json in `out`; 0 if accurate enough."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="tracemesh-demo-") as folder, _server(Path(folder), port) as server:
        session = _new_session(server)
        _scan(server, session, Path(folder))
        names = ("network.json", "mesh.glb", "report.json")
        reconstruction = _reconstruct(server, session)
        files = {name: server.request("GET", f"/reconstructions/{reconstruction}/{name}") for name in names}
    measured = _measure(files["network.json"])
    report = {**json.loads(files["report.json"]), "shape": SHAPE, "error": measured.summary()}
    files["report.json"] = (json.dumps(report, indent=1) + "\n").encode()
    write_all({out / name: content for name, content in files.items()})
    accurate = measured.mean <= LARGEST_MEAN_ERROR
    verdict = "at most" if accurate else "more than"
    print(f"mean error {measured.mean:.3f} % of the diagonal, {verdict} {LARGEST_MEAN_ERROR:g} %; files in {out}")
    return 0 if accurate else 1


def _measure(network: bytes) -> Evaluation:
    """Distance of the network's points from the shape, after rigid registration: the device knows no origin."""
    read = read_network(network.decode(), "network.json")
    return evaluate(read.points, read.normals, *SHAPES[SHAPE]().mesh(), align="rigid")


def _new_session(server: Server) -> str:
    return str(server.json("POST", "/sessions", {"name": f"Demo: {SHAPE}"})["id"])


def _scan(server: Server, session: str, folder: Path) -> None:
    """Let the virtual device ride all curves; returns when the server has acknowledged every sample."""
    port = folder / "morphorider"
    uplink = ("--server", f"http://{server.address}", "--session", session, "--spool", folder / "spool")
    device = _bridge("virtual", "--shape", SHAPE, "--speed", SPEED, "--link", port)
    bridge = _bridge("morphorider", "--port", port, "--rate", READINGS_PER_SECOND * SPEED, *uplink)
    with _process(device, stdout=subprocess.PIPE) as operator, _process(bridge, stdin=operator.stdout) as recorder:
        if recorder.wait() != 0:
            raise TracemeshError(f"the bridge stopped with status {recorder.returncode}")


def _reconstruct(server: Server, session: str) -> str:
    """Identifier of a reconstruction that is done; raises TracemeshError with the job's own words when it fails."""
    job = server.json("POST", f"/sessions/{session}/reconstructions", {})
    with ProgressLine() as progress:
        while job["state"] in ("queued", "running"):
            progress(job["stage"], job["fraction"])
            time.sleep(0.1)
            job = server.json("GET", f"/reconstructions/{job['id']}")
    if job["state"] != "done":
        raise TracemeshError(f"the reconstruction is {job['state']}: {job['error']}")
    return str(job["id"])


@contextmanager
def _server(folder: Path, port: int) -> Iterator[Server]:
    """A server of its own on loopback with an empty data folder."""
    port = port or _free_port()
    address = f"127.0.0.1:{port}"
    command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(port), "--data-dir", str(folder / "data")]
    with _process(command) as process:
        _await_health(process, address)
        yield Server(address)


def _await_health(process: "subprocess.Popen[str]", address: str) -> None:
    give_up = time.monotonic() + PATIENCE
    while time.monotonic() < give_up:
        if process.poll() is not None:
            raise TracemeshError(
                f"the server stopped with status {process.returncode}; is {address} taken? --port 0 takes a free one"
            )
        try:
            urllib.request.urlopen(f"http://{address}/healthz", timeout=1).close()
        except OSError:
            time.sleep(0.05)
        else:
            return
    raise TracemeshError(f"the server at {address} did not answer within {PATIENCE:g} s")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _bridge(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "tracemesh_bridge", *map(str, arguments)]


@contextmanager
def _process(
    command: Sequence[str], stdin: IO[str] | None = None, stdout: int | None = None
) -> Iterator["subprocess.Popen[str]"]:
    """A process that is gone when the block is left; what it said is shown only if something went wrong."""
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(command, stdin=stdin, stdout=stdout, stderr=said, text=True)
        try:
            yield process
        except TracemeshError:
            said.seek(0)
            sys.stderr.write(said.read())
            raise
        finally:
            _end(process)


def _end(process: "subprocess.Popen[str]") -> None:
    process.terminate()
    try:
        process.wait(timeout=10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
