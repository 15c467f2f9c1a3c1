"""Take the pictures of docs/devices: what the bridge really says in a terminal, and the scanning page, in Chromium.

.venv/bin/python tools/take_device_pictures.py [NAME ...]     all when none is named
"""

import fcntl
import html
import json
import os
import pty
import shlex
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

PICTURES = Path(__file__).resolve().parent.parent / "docs" / "pictures" / "devices"
COLUMNS = 118
STYLE = """<style>body { margin: 0; background: #14191f; }
pre { margin: 0; padding: 16px 20px; color: #d7dee6; width: max-content;
  font: 14px/1.45 'DejaVu Sans Mono', monospace; }
b { color: #7fc8a9; font-weight: normal; }</style>"""
FLAGS = ("--no-sandbox", "--disable-quic", "--no-first-run", "--enable-unsafe-swiftshader")
RIDE = ("virtual", "--link", "rider", "--seed", "4")


def main(chosen: list[str]) -> None:
    """Every picture, or the chosen ones."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder, server(Path(folder)) as address:
        os.chdir(folder)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        for name, take in terminals(address).items():
            if not chosen or name in chosen:
                draw(browser, name, take())
        if not chosen or "browser" in chosen:
            scanning_page(browser, address)
        browser.close()


def terminals(address: str) -> dict[str, Callable[[], str]]:
    """What each terminal shows."""
    here = ("--server", address)
    phone = free_port()
    return {
        "morphorider": lambda: bridge(RIDE, ["morphorider", "--port", "rider", *here], 14),
        "inspect": lambda: bridge((*RIDE, "--speed", "8"), ["inspect", "--port", "rider", "--count", "4"], 0),
        "doctor": lambda: bridge((*RIDE, "--speed", "3"), ["doctor", "--port", "rider", *here], 0),
        "calibrate-begin": lambda: calibrate(here, 14),
        "calibrate-end": lambda: calibrate(here, 0),
        "sensorserver": lambda: bridge(
            ("virtual-phone", "--app", "sensorserver", "--port", str(phone)),
            ["sensorserver", "--address", f"127.0.0.1:{phone}", *here],
            12,
        ),
        "sensorlogger": lambda: bridge(
            ("virtual-phone", "--app", "sensorlogger", "--url", f"http://127.0.0.1:{phone}"),
            ["sensorlogger", "--host", "127.0.0.1", "--port", str(phone), *here],
            12,
        ),
        "phyphox": lambda: bridge(
            ("virtual-phone", "--app", "phyphox", "--port", str(phone)),
            ["phyphox", "--address", f"http://127.0.0.1:{phone}", *here],
            12,
        ),
    }


def calibrate(here: tuple[str, ...], seconds: float) -> str:
    """The screen of a calibration after so many seconds, or at its end, twice as fast as life."""
    device = (*RIDE, "--calibrating", "--distortion", crooked(), "--speed", "2")
    command = ["calibrate", "--port", "rider", "--rate", "120", "--place", "the lab", *here]
    return bridge(device, command, seconds)


def bridge(device: tuple[str, ...], command: list[str], seconds: float) -> str:
    """The screen of a bridge command that a virtual device's operator types into; after `seconds`, or at its end."""
    program = str(Path(sys.executable).with_name("tracemesh-bridge"))
    screen, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, COLUMNS, 0, 0))
    with subprocess.Popen([program, *device], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as virtual:
        while "--link" in device and not Path("rider").exists():
            time.sleep(0.1)
        time.sleep(2.5 if "--app" in device else 0.2)  # a phone's page cannot be seen from here
        folder = [] if command[0] in ("inspect", "doctor", "calibrate") else ["--spool", tempfile.mkdtemp()]
        shown = subprocess.Popen([program, *command, *folder], stdin=virtual.stdout, stdout=terminal, stderr=terminal)
        os.close(terminal)
        said = read(screen, shown, seconds)
        for process in (shown, virtual):
            process.send_signal(signal.SIGINT)
        shown.wait(20)
    return f"$ tracemesh-bridge {shlex.join(command)}\n{as_seen(said)}"


def read(screen: int, process: "subprocess.Popen[bytes]", seconds: float) -> str:
    """All that a process writes on its screen in so many seconds, or until it ends."""
    said = b""
    os.set_blocking(screen, False)
    begin = time.monotonic()
    while process.poll() is None and (not seconds or time.monotonic() - begin < seconds):
        with suppress(BlockingIOError, OSError):
            said += os.read(screen, 65536)
        time.sleep(0.02)
    with suppress(BlockingIOError, OSError):
        said += os.read(screen, 65536)
    return said.decode()


def as_seen(said: str) -> str:
    """What is left on a terminal: a carriage return begins the line again."""
    lines = said.replace("\r\n", "\n").replace("\x1b[K", "").replace("\a", "").split("\n")
    rows = [line.split("\r")[-1] for line in lines]
    return "\n".join(row[i : i + COLUMNS] for row in rows for i in range(0, max(len(row), 1), COLUMNS)).rstrip()


def crooked() -> str:
    """A device with a magnet and steel on it, and a worn wheel."""
    exact = {"coverage": 1, "spread_before": 0, "spread_after": 0}
    up = {"matrix": [[0.98, 0.01, 0], [0.01, 1.02, 0], [0, 0, 1]], "offset": [0.01, -0.015, 0.005]}
    field = {"matrix": [[0.87, -0.05, 0], [-0.05, 1.1, 0.03], [0, 0.03, 1.05]], "offset": [0.12, -0.08, 0.05]}
    device = {"device": "morphorider", "made": "2026-05-03T10:00:00Z", "circumference": 0.097}
    Path("crooked.json").write_text(json.dumps({**device, "accelerometer": up | exact, "magnetometer": field | exact}))
    return "crooked.json"


def draw(browser: Browser, name: str, text: str) -> None:
    """One terminal as a picture."""
    page = browser.new_page(viewport={"width": 1100, "height": 200}, device_scale_factor=1.5)
    first, _, rest = html.escape(text).partition("\n")
    page.set_content(f"{STYLE}<pre><b>{first}</b>\n{rest}</pre>")
    page.locator("pre").screenshot(path=PICTURES / f"{name}.png")
    page.close()


def scanning_page(browser: Browser, address: str) -> None:
    """The scanning page on a phone, and on a computer with Web Serial."""
    request = urllib.request.Request(f"{address}/api/v1/sessions", b"{}", {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=20) as answer:
        session = json.load(answer)["id"]
    for name, size in (("phone", (390, 700)), ("web-serial", (1000, 560))):
        page = browser.new_page(viewport={"width": size[0], "height": size[1]}, device_scale_factor=1.5)
        page.goto(f"{address}/scan.html#{session}")
        page.wait_for_timeout(1500)
        page.screenshot(path=PICTURES / f"{name}.png")
        page.close()


@contextmanager
def server(folder: Path) -> Iterator[str]:
    """A server with an empty folder; its address."""
    port = free_port()
    command = [sys.executable, "-m", "tracemesh", "serve", "--port", str(port), "--data-dir", str(folder / "data")]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        address = f"http://127.0.0.1:{port}"
        while True:
            try:
                urllib.request.urlopen(f"{address}/healthz", timeout=1).close()
                break
            except OSError:
                time.sleep(0.1)
        try:
            yield address
        finally:
            process.send_signal(signal.SIGINT)


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


if __name__ == "__main__":
    main(sys.argv[1:])
