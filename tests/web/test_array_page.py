"""A fixed array that moves before a browser: its shape live at its rate, any stored reading, and a surface of one."""

import io
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.web.support import PATIENCE, Server
from tracemesh.geometry.simulated.moving_arrays import lattice, ribbon
from tracemesh.wire.device import Device, Hello
from tracemesh_bridge.sources.virtual_array import declare, measure

RATE = 20.0


@contextmanager
def bridge(server: Server, session: str, folder: Path) -> Iterator[None]:
    """The virtual ribbon behind the real bridge, until the block ends."""
    command = [sys.executable, "-m", "tracemesh_bridge"]
    topology = folder / "ribbon.json"
    topology.write_bytes(subprocess.run([*command, "virtual-array", "ribbon", "--declare"], capture_output=True).stdout)
    options = ["--topology", topology, "--server", f"http://{server.address}", "--session", session]
    program = [*command, "virtual-array", "ribbon", "--rate", str(RATE)]
    recording = [*command, "array", *options, "--spool", folder / "spool", "--", *program]
    with (
        (folder / "bridge.log").open("w") as log,
        subprocess.Popen(recording, stdin=subprocess.PIPE, stderr=log, env={**os.environ}) as process,
    ):
        try:
            yield
        finally:
            process.communicate(b"q", timeout=PATIENCE)


def test_a_ribbon_moves_live_and_every_reading_can_be_looked_at(server: Server, page: Page, tmp_path: Path) -> None:
    session = server.call("POST", "/sessions", {"name": "Ribbon"})["id"]
    page.goto(server.page(f"#/sessions/{session}"))
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    view = page.locator("canvas")
    with bridge(server, session, tmp_path):
        page.wait_for_function("Number(document.querySelector('canvas').dataset.reading) >= 5")
        page.keyboard.press("2")
        seen, pictures = [], []
        while len(seen) < 2 or seen[-1] < 60:
            seen.append(int(view.get_attribute("data-reading") or 0))
            pictures.append(view.screenshot())
        assert len(set(pictures)) > 1, "nothing moves"
    assert seen == sorted(seen)
    count = server.call("GET", f"/sessions/{session}/readings")["count"]
    expect(page.get_by_text(f"of {count},")).to_be_visible()
    for number in (20, 60):
        page.get_by_label("Reading", exact=True).fill(str(number))
        expect(view).to_have_attribute("data-reading", str(number))
        assert drawn_proportion(view) == pytest.approx(true_proportion(number / RATE), abs=0.04)
    page.get_by_role("button", name="Newest").click()
    expect(view).to_have_attribute("data-reading", str(count - 1))


def drawn_proportion(view: Locator) -> float:
    """Height over width of the interior curves in a picture of the view."""
    time.sleep(0.5)  # what was asked for is drawn in the next frame
    css = "getComputedStyle(document.documentElement).getPropertyValue('--curve-interior').trim()"
    text = view.page.evaluate(css)
    wanted = np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)])
    picture = np.asarray(Image.open(io.BytesIO(view.screenshot())).convert("RGB")).astype(int)
    rows, columns = np.nonzero(np.abs(picture - wanted).sum(axis=2) < 24)
    assert len(rows) > 200, "the view is blank"
    return float(np.ptp(rows) / np.ptp(columns))


def true_proportion(at: float) -> float:
    """Height over width of the ribbon as seen from the front."""
    moving = ribbon()
    line: NDArray[np.float64] = np.linspace(moving.flat[0], moving.flat[-1], 500)
    x, _, z = np.ptp(moving.positions(at, line), axis=0)
    return float(z / x)


def test_a_surface_is_made_of_a_reading_of_a_lattice(server: Server, page: Page) -> None:
    session = server.call("POST", "/sessions", {"name": "Lattice"})["id"]
    moving, generator = lattice(5, 6), np.random.default_rng(0)
    device = Device(id="sheet", kind="array", array=declare(moving))
    readings = [
        measure(moving, n / RATE, 0.0, generator).model_copy(update={"seq": n}).model_dump_json(exclude_none=True)
        for n in range(8)
    ]
    hello = Hello(recording="sheet", device=device).model_dump_json(exclude_none=True)
    server.upload(session, "\n".join([hello, *readings]))
    page.goto(server.page(f"#/sessions/{session}"))
    view = page.locator("canvas")
    expect(view).to_have_attribute("data-reading", "7")
    page.get_by_label("Reading", exact=True).fill("3")
    expect(view).to_have_attribute("data-reading", "3")
    page.get_by_role("button", name="Reconstruct").click()
    expect(view).to_have_attribute("data-surface", "shown")
    (job,) = server.call("GET", f"/sessions/{session}/reconstructions")
    assert job["parameters"]["reading"] == 3
    network = server.call("GET", f"/reconstructions/{job['id']}/network.json")
    truth = moving.positions(3 / RATE)
    nodes = np.array(network["points"])[network["nodes"]]
    assert nodes == pytest.approx(truth - truth.mean(axis=0), abs=2e-3)
