"""The whole way at a desk, nothing but real parts: a virtual Morphorider on a pseudo-terminal, bridge, server, page.

A person watches, edits, moves a slider, spans the surface, looks at it and takes it home.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.web.support import PATIENCE, Server, share_of_pixels
from tracemesh.formats.meshes import read_mesh
from tracemesh.geometry.comparison.evaluation import evaluate
from tracemesh.geometry.simulated.shapes import leaf

SPEED = 8.0
"""How many times faster than a hand the device is moved."""


def test_from_a_device_to_a_file(server: Server, page: Page, tmp_path: Path) -> None:
    page.goto(server.page())
    page.get_by_label("Name of the new session").fill("Leaf")
    page.get_by_role("button", name="New session").click()
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    session = page.url.rsplit("/", 1)[1]
    curves = page.get_by_role("complementary", name="Curves and nodes")
    nodes = curves.get_by_role("list", name="Marked nodes").get_by_role("listitem")
    view = page.locator("canvas")

    with _riding(server, session, tmp_path) as bridge:  # live: curves grow, nodes appear, health is in sight
        expect(page.locator("header").get_by_text("dip")).to_be_visible()
        expect(page.locator("header").get_by_text("Hz")).to_be_visible()
        expect(curves.get_by_role("button", name="1 boundary")).to_be_visible()
        expect(nodes.nth(2)).to_be_visible()
        expect(curves.get_by_role("button", name="interior").first).to_be_visible()
        assert bridge.wait(PATIENCE) == 0
    expect(curves.get_by_role("button", name="interior")).to_have_count(4)
    expect(nodes).to_have_count(11)
    assert share_of_pixels(view, "curve-boundary")[0] > 0.0005

    page.keyboard.press("]")  # nodes: one more on curve 1, and away again
    expect(page.get_by_role("slider", name="Place on curve 1")).to_be_visible()
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("a")
    expect(nodes).to_have_count(12)
    page.keyboard.press("u")
    expect(nodes).to_have_count(11)
    page.keyboard.press("Escape")

    page.get_by_text("Parameters").click()  # sliders: what is automatic says what was chosen
    page.get_by_role("slider", name="Step").fill("0.45")
    expect(page.get_by_title("Smooths over this length by resisting change of curvature")).to_contain_text("mm")

    page.get_by_role("button", name="Reconstruct").click()
    expect(view).to_have_attribute("data-surface", "shown")
    for look in ("Isophotes", "Reflection lines", "Normal map", "Mean curvature", "Gaussian curvature", "Shaded"):
        page.get_by_label(look, exact=True).check()
        page.wait_for_timeout(100)
        assert share_of_pixels(view, "view")[0] < 0.97

    with page.expect_download() as download:
        page.get_by_role("link", name="Surface (GLB)").click()
    download.value.save_as(tmp_path / "leaf.glb")
    vertices, _ = read_mesh((tmp_path / "leaf.glb").read_bytes(), "glb")
    assert evaluate(vertices, None, *leaf().mesh(), align="rigid").mean < 1.0  # %, the thesis's own figure


@contextmanager
def _riding(server: Server, session: str, folder: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """The bridge, which ends when its virtual device has ridden all curves."""
    port = folder / "rider"
    device = ["virtual", "--shape", "leaf", "--speed", str(SPEED), "--link", str(port)]
    uplink = ["--server", f"http://{server.address}", "--session", session, "--spool", str(folder / "spool")]
    bridge = ["morphorider", "--port", str(port), "--rate", str(60 * SPEED), *uplink]
    command = [sys.executable, "-m", "tracemesh_bridge"]
    with ExitStack() as stack:
        log = stack.enter_context((folder / "bridge.log").open("wb"))
        rider = stack.enter_context(subprocess.Popen([*command, *device], stdout=subprocess.PIPE, stderr=log))
        stack.callback(rider.kill)
        recorder = stack.enter_context(subprocess.Popen([*command, *bridge], stdin=rider.stdout, stderr=log))
        stack.callback(recorder.kill)
        yield recorder
