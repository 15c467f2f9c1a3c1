"""Take the README's pictures: run the demo, watch it in Chromium, keep three moments.

.venv/bin/python tools/take_pictures.py
"""

import json
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

PICTURES = Path(__file__).resolve().parent.parent / "docs" / "pictures"
FLAGS = [
    *("--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader"),
]


def main() -> None:
    """One demo from beginning to end."""
    demo = subprocess.Popen(
        [sys.executable, "-m", "tracemesh", "demo", "--port", "0"], stdout=subprocess.PIPE, text=True
    )
    try:
        assert demo.stdout is not None
        address = demo.stdout.readline().split()[-1]
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
            page = browser.new_page(viewport={"width": 1120, "height": 700})
            page.goto(address)
            watch(page, address.replace("/#/", "/api/v1/"))
            browser.close()
    finally:
        demo.send_signal(signal.SIGINT)
        demo.wait(30)


def watch(page: Page, session: str) -> None:
    """The second of five curves, the whole network, the surface."""
    for name, reached in (
        ("1-curves", lambda s: s["nodes"] >= 9),
        ("2-network", lambda s: s["nodes"] >= 11 and curves_ended(session) == 5),
        ("3-surface", lambda s: s["latest_reconstruction"]),
    ):
        while not reached(get(session)):
            page.wait_for_timeout(100)
        page.wait_for_timeout(1500 if name == "3-surface" else 400)
        page.screenshot(path=PICTURES / f"{name}.png")


def curves_ended(session: str) -> int:
    """How many curves are scanned to their end."""
    return sum(curve["ended"] for curve in get(f"{session}/curves"))


def get(url: str) -> Any:
    """What the REST API answers."""
    with urllib.request.urlopen(url, timeout=20) as answer:
        return json.load(answer)


if __name__ == "__main__":
    main()
