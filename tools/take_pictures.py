"""Take the pictures of the pages that README and docs show, in Chromium, through a real server.

.venv/bin/python tools/take_pictures.py [demo] [page]     all when none is named
"""

import json
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from playwright.sync_api import Browser, CDPSession, Page, expect, sync_playwright
from scipy.spatial.transform import Rotation

from tracemesh.formats.meshes import write_triangles
from tracemesh.formats.recordings import recording_from_simulation, write_recording
from tracemesh.geometry.simulated.moving_arrays import NOISE, lattice
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import plan_scan, simulate_scan
from tracemesh.wire.device import Device, Hello, NodeMark
from tracemesh_bridge.sources.virtual_array import declare, measure

PICTURES = Path(__file__).resolve().parent.parent / "docs" / "pictures"
FLAGS = [
    *("--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader"),
]
DESK, PHONE = {"width": 1280, "height": 760}, {"width": 390, "height": 844}
SENSORS = ["accelerometer", "gyroscope", "magnetometer"]
LOOKS = ("Shaded", "Isophotes", "Reflection lines", "Normal map", "Mean curvature", "Gaussian curvature")
THEMES: tuple[tuple[str, Literal["light", "dark"]], ...] = (("", "light"), ("dark-", "dark"))
"""What the names of pictures begin with, by theme."""
PATIENCE = 60_000
"""ms until something that should be seen counts as missing."""


def main(chosen: list[str]) -> None:
    """The README's three moments of a demo; then the page in every state, from what the demo left."""
    with sync_playwright() as playwright, demo() as address:
        expect.set_options(timeout=PATIENCE)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        watch(browser, address, keep="demo" in chosen or not chosen)
        if "page" in chosen or not chosen:
            show_page(browser, address)
            show_array(browser, address)
            show_theme_and_phone(browser, address)
            show_measured(browser, address.split("/#/")[0])
            show_sharing(browser)
        browser.close()


@contextmanager
def demo() -> Iterator[str]:
    """A demo that runs; the address of its session's page."""
    command = [sys.executable, "-m", "tracemesh", "demo", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[-1]
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)


def watch(browser: Browser, address: str, keep: bool) -> None:
    """The second of five curves, the whole network, the surface."""
    page = browser.new_page(viewport={"width": 1120, "height": 700})
    page.goto(address)
    session = api(address)
    for name, reached in (
        ("1-curves", lambda s: s["nodes"] >= 9),
        ("2-network", lambda s: s["nodes"] >= 11 and curves_ended(session) == 5),
        ("3-surface", lambda s: s["latest_reconstruction"]),
    ):
        while not reached(get(session)):
            page.wait_for_timeout(100)
        page.wait_for_timeout(1500 if name == "3-surface" else 400)
        if keep:
            page.screenshot(path=PICTURES / f"{name}.png")
    page.close()


def show_page(browser: Browser, address: str) -> None:
    """Every look and state of the desk page."""
    page = browser.new_page(viewport=DESK, color_scheme="light", reduced_motion="reduce")
    page.goto(address)
    expect(page.locator("canvas")).to_have_attribute("data-surface", "shown")
    for look in LOOKS:
        page.get_by_label(look).check()
        keep(page, f"look-{look.lower().replace(' ', '-')}")
    compared(page)
    page.get_by_label("Shaded").check()
    for name, keys in (("uncertainty", "sw"), ("curvature-plot", "swpkb"), ("normals", "pkbv"), ("help", "v?")):
        for key in keys:
            page.keyboard.press(key)
        keep(page, name)
    page.keyboard.press("Escape")
    editing(page)
    page.get_by_role("link", name="tracemesh").click()
    keep(page, "sessions")
    page.get_by_label("Name of the new session").fill("Lamp")
    page.get_by_role("button", name="New session").click()
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    keep(page, "empty-session")
    page.close()


def show_array(browser: Browser, address: str) -> None:
    """A reading of a waving lattice, and its surface."""
    origin, generator, moving = address.split("/#/")[0], np.random.default_rng(0), lattice()
    device = Device(id="lattice", kind="array", array=declare(moving))
    readings = [measure(moving, n / 30, NOISE, generator).model_copy(update={"seq": n}) for n in range(60)]
    lines = [m.model_dump_json(exclude_none=True) for m in (Hello(recording="lattice", device=device), *readings)]
    post(origin, "/sessions", b'{"id": "lattice"}')
    post(origin, "/sessions/lattice/recordings", "\n".join(lines).encode())
    for name, theme in THEMES:
        page = browser.new_page(viewport=DESK, color_scheme=theme, reduced_motion="reduce")
        page.goto(f"{origin}/#/sessions/lattice")
        expect(page.locator("canvas")).to_have_attribute("data-reading", "59")
        page.get_by_role("button", name="Reconstruct").click()
        expect(page.locator("canvas")).to_have_attribute("data-surface", "shown")
        keep(page, f"{name}array")
        page.close()


def compared(page: Page) -> None:
    """The surface in the colours of its distance to the true leaf."""
    with tempfile.NamedTemporaryFile(suffix=".obj") as truth:
        Path(truth.name).write_bytes(write_triangles(*leaf().mesh(), "obj"))
        page.get_by_label("Compare with a true mesh").set_input_files(truth.name)
        expect(page.get_by_text("Distance to truth (mm)")).to_be_visible()
    keep(page, "look-distance-to-truth")


def editing(page: Page) -> None:
    """A curve is chosen, its actions are offered; the parameters are open."""
    page.get_by_role("button", name="3 interior").click()
    page.get_by_text("Parameters").click()
    keep(page, "editing")


def show_theme_and_phone(browser: Browser, address: str) -> None:
    """The dark theme, and the scanning page on a phone."""
    dark = browser.new_page(viewport=DESK, color_scheme="dark", reduced_motion="reduce")
    dark.goto(address)
    expect(dark.locator("canvas")).to_have_attribute("data-surface", "shown")
    keep(dark, "dark")
    show_problems(dark)
    dark.get_by_role("link", name="tracemesh").click()
    keep(dark, "dark-sessions")
    dark.close()
    phone = browser.new_page(viewport=PHONE, device_scale_factor=2, reduced_motion="reduce")
    phone.goto(address.replace("/#/sessions/", "/scan.html#"))
    keep(phone, "scan-start")
    phone.close()
    origin = address.split("/#/")[0]
    show_curve(browser, origin)
    show_refusal(browser, origin)
    show_air(browser, origin)


def show_problems(page: Page) -> None:
    """A curve that bounds nothing is called a boundary, until it has been seen."""
    page.get_by_role("button", name="2 interior").click()
    page.get_by_role("button", name="Make boundary").click()
    expect(page.locator("main svg polyline.flag")).to_have_count(2)
    keep(page, "dark-problems")
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("main svg .flag")).to_have_count(0)


def show_curve(browser: Browser, origin: str) -> None:
    """A curve while it is scanned, its first node marked, in the dark theme."""
    phone, hand = held(browser, origin, "Lamp shade", "dark")
    phone.get_by_role("button", name="Start curve").click()
    lead(phone, hand, 0.1, 0.2)
    phone.get_by_role("button", name="Mark node").click()
    lead(phone, hand, 0.2, 3.0)
    shoot(phone, "scan-curve")
    phone.close()


def show_refusal(browser: Browser, origin: str) -> None:
    """The sensors may not be read, in the dark theme."""
    context = browser.new_context(viewport=PHONE, device_scale_factor=2, color_scheme="dark", permissions=[])
    phone = context.new_page()
    devtools = context.new_cdp_session(phone)
    for sensor in SENSORS:
        devtools.send("Browser.setPermission", {"permission": {"name": sensor}, "setting": "denied"})
    phone.goto(f"{origin}/scan.html#{create(origin, 'Vase')}")
    phone.get_by_role("button", name="Use this device's sensors").click()
    expect(phone.get_by_role("alert")).to_be_visible()
    shoot(phone, "scan-refused")
    context.close()


def show_air(browser: Browser, origin: str) -> None:
    """Two strokes drawn in the air; the hand goes on moving."""
    phone, hand = held(browser, origin, "In the air", "light")
    phone.get_by_role("button", name="in the air").click()
    for start, end in ((0.0, 2.4), (2.4, 4.2)):
        phone.get_by_role("button", name="Hold to draw").hover()
        phone.mouse.down()
        lead(phone, hand, start, end)
        phone.mouse.up()
    lead(phone, hand, 4.2, 4.8)
    shoot(phone, "scan-in-the-air")
    phone.close()


def held(browser: Browser, origin: str, name: str, theme: Literal["light", "dark"]) -> tuple[Page, CDPSession]:
    """A phone that reads the browser's own orientation sensor, overridden, into a new session."""
    granted = [*SENSORS, "screen-wake-lock"]
    phone = browser.new_page(
        viewport=PHONE, device_scale_factor=2, reduced_motion="reduce", permissions=granted, color_scheme=theme
    )
    hand = phone.context.new_cdp_session(phone)
    sensor, metadata = "absolute-orientation", {"available": True, "maximumFrequency": 60, "minimumFrequency": 1}
    hand.send("Emulation.setSensorOverrideEnabled", {"enabled": True, "type": sensor, "metadata": metadata})
    phone.goto(f"{origin}/scan.html#{create(origin, name)}")
    phone.get_by_role("button", name="Use this device's sensors").click()
    lead(phone, hand, 0.0, 0.1)
    return phone, hand


def show_measured(browser: Browser, origin: str) -> None:
    """A scan without marks whose device has a calibration that is not used: nodes were found, in either theme."""
    recording = recording_from_simulation(simulate_scan(plan_scan(leaf())), "leaf")
    left = [message for message in recording.messages if not isinstance(message, NodeMark)]
    unmarked = replace(recording, messages=[m.model_copy(update={"seq": n}) for n, m in enumerate(left)])
    session = create(origin, "Unmarked leaf")
    post(origin, f"/sessions/{session}/recordings", write_recording(unmarked).encode())
    calibration = {"device": "simulated", "made": "2026-05-03T10:00:00Z", "place": "the lab", "circumference": 0.2}
    post(origin, "/devices/simulated/calibrations", json.dumps({"calibration": calibration}).encode())
    for name, theme in THEMES:
        page = browser.new_page(viewport=DESK, color_scheme=theme, reduced_motion="reduce")
        page.goto(f"{origin}/#/sessions/{session}")
        page.get_by_role("button", name="Find unmarked nodes").click()
        expect(page.get_by_text("Calibration 1 is available; it is not used.")).to_be_visible()
        expect(page.get_by_role("button", name="Accept").first).to_be_visible()
        keep(page, f"{name}found-nodes")
        page.close()


def show_sharing(browser: Browser) -> None:
    """The owner's panel with the code by which a phone comes in, in either theme."""
    with tempfile.TemporaryDirectory() as folder, closed_server(Path(folder)) as address:
        origin = address.split("/?")[0]
        for name, theme in THEMES:
            context = browser.new_context(viewport=DESK, color_scheme=theme, reduced_motion="reduce")
            page = context.new_page()
            page.goto(address)
            page.get_by_label("Name of the new session").fill("Lamp")
            page.get_by_role("button", name="New session").click()
            page.get_by_role("button", name="Share").click()
            page.get_by_role("button", name="Let a phone scan").click()
            expect(page.get_by_role("img", name="QR code of the scan page")).to_be_visible()
            assert page.url.startswith(origin)
            keep(page, f"{name}share")
            context.close()


@contextmanager
def closed_server(folder: Path) -> Iterator[str]:
    """A server that demands a token; the address that lets its owner in."""
    token = secrets.token_urlsafe(24)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(port), "--data-dir", str(folder)]
    process = subprocess.Popen(command, env={**os.environ, "TRACEMESH_TOKEN": token}, stdout=subprocess.DEVNULL)
    try:
        while process.poll() is None and not answers(port):
            time.sleep(0.1)
        yield f"http://127.0.0.1:{port}/?token={token}"
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)


def answers(port: int) -> bool:
    """Whether somebody listens there."""
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
    except OSError:
        return False
    return True


def post(origin: str, path: str, body: bytes) -> None:
    """Send something to the REST API."""
    headers = {"Content-Type": "application/json"}
    urllib.request.urlopen(urllib.request.Request(f"{origin}/api/v1{path}", body, headers), timeout=20).close()


def create(origin: str, name: str) -> str:
    """A new session of this name."""
    request = urllib.request.Request(f"{origin}/api/v1/sessions", json.dumps({"name": name}).encode())
    request.add_header("Content-Type", "application/json")
    with urllib.request.urlopen(request, timeout=20) as answer:
        made: str = json.load(answer)["id"]
    return made


def lead(phone: Page, hand: CDPSession, start: float, end: float) -> None:
    """The phone around a circle, top edge first, from one place to another, rad."""
    for angle in np.arange(start, end, 0.01):
        axes = Rotation.from_euler("zx", [angle, 0.9])
        x, y, z, w = (float(v) for v in axes.as_quat())
        reading = {"quaternion": {"x": x, "y": y, "z": z, "w": w}}
        hand.send("Emulation.setSensorOverrideReadings", {"type": "absolute-orientation", "reading": reading})
        phone.wait_for_timeout(16)


def keep(page: Page, name: str) -> None:
    """One picture, once everything has settled."""
    page.wait_for_timeout(800)
    shoot(page, name)


def shoot(page: Page, name: str) -> None:
    """One picture as it is now."""
    folder = PICTURES / "page"
    folder.mkdir(exist_ok=True)
    page.screenshot(path=folder / f"{name}.jpg", type="jpeg", quality=85)


def curves_ended(session: str) -> int:
    """How many curves are scanned to their end."""
    return sum(curve["ended"] for curve in get(f"{session}/curves"))


def api(address: str) -> str:
    """The session of a page over REST."""
    return address.replace("/#/", "/api/v1/")


def get(url: str) -> Any:
    """What the REST API answers."""
    with urllib.request.urlopen(url, timeout=20) as answer:
        return json.load(answer)


if __name__ == "__main__":
    main(sys.argv[1:])
