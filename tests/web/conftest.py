"""The pages as a person meets them: a real server process, a real browser, a device on the real ingest socket."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright
from websockets.sync.client import connect

from tests.web.support import PATIENCE, Rider, Server, free_port, running_server
from tracemesh.formats.recordings import recording_from_simulation
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import plan_scan, simulate_scan

CHROMIUM = "/usr/bin/chromium"
FLAGS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
)

SENSORS = ["accelerometer", "gyroscope", "magnetometer"]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with an empty data folder, shared by the tests of a file."""
    with running_server(tmp_path_factory.mktemp("data"), free_port()) as server:
        server.await_health()
        yield server


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Headless Chromium of the distribution; WebGL in software."""
    assert Path(CHROMIUM).exists(), f"wanted Chromium in {CHROMIUM}"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An empty page that fails the test when a script of it fails."""
    context = browser.new_context(viewport={"width": 1280, "height": 720}, reduced_motion="reduce")
    page = context.new_page()
    page.set_default_timeout(1000 * PATIENCE)
    expect.set_options(timeout=1000 * PATIENCE)
    failures: list[str] = []
    page.on("pageerror", lambda error: failures.append(str(error)))
    yield page
    context.close()
    assert not failures


@pytest.fixture
def phone(browser: Browser) -> Iterator[Page]:
    """An empty page of a phone that may read its sensors."""
    context = browser.new_context(
        viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True, permissions=SENSORS
    )
    page = context.new_page()
    page.set_default_timeout(1000 * PATIENCE)
    expect.set_options(timeout=1000 * PATIENCE)
    yield page
    context.close()


@pytest.fixture
def rider(server: Server) -> Iterator[Callable[[str], Rider]]:
    """Connects a Morphorider that will scan the leaf into a session."""
    with ExitStack() as connections:

        def start(session: str) -> Rider:
            address = f"ws://{server.address}/api/v1/ingest"
            connection = connections.enter_context(connect(address, open_timeout=PATIENCE))
            curves = simulate_scan(plan_scan(leaf()))
            return Rider(connection, recording_from_simulation(curves, f"ride-{session}", session))

        yield start
