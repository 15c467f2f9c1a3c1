"""No page has a fault that axe can find, in either theme."""

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.web.support import Rider, Server

AXE = Path(__file__).resolve().parents[2] / "web/node_modules/axe-core/axe.min.js"


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_pages_are_accessible(server: Server, page: Page, rider: Callable[[str], Rider], theme: str) -> None:
    session = server.call("POST", "/sessions", {"name": f"Leaf, {theme}"})["id"]
    empty = server.call("POST", "/sessions", {"name": "Empty"})["id"]
    rider(session).ride(lambda m: False)
    server.call("POST", f"/sessions/{session}/reconstructions", {})
    page.goto(server.page())
    page.evaluate("theme => localStorage.setItem('theme', theme)", theme)
    page.reload()
    expect(page.get_by_role("link", name=f"Leaf, {theme}")).to_be_visible()
    assert _faults(page) == []

    page.goto(server.page(f"#/sessions/{empty}"))
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    assert _faults(page) == []

    page.goto(server.page(f"#/sessions/{session}"))
    expect(page.locator("canvas").first).to_have_attribute("data-surface", "shown")
    page.get_by_role("button", name="2 interior").click()
    page.get_by_text("Parameters").click()
    page.get_by_label("Mean curvature").check()
    page.get_by_label("Curvature along a curve").check()
    expect(page.get_by_role("heading", name="Curvature along curve 2")).to_be_visible()
    assert _faults(page) == []
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    assert _faults(page) == []

    page.goto(server.page(f"scan.html#{session}"))
    expect(page.get_by_role("button", name="Use this device's sensors")).to_be_visible()
    assert _faults(page) == []


def test_panels_do_not_overlap(server: Server, page: Page, rider: Callable[[str], Rider]) -> None:
    session = server.call("POST", "/sessions", {"name": "Leaf, sizes"})["id"]
    rider(session).ride(lambda m: False)
    page.goto(server.page(f"#/sessions/{session}"))
    expect(page.get_by_role("button", name="5 interior")).to_be_visible()
    for width, height in ((1280, 720), (820, 1180), (1920, 1080), (390, 780)):
        page.set_viewport_size({"width": width, "height": height})
        boxes = [b for part in page.locator("header, aside, main").all() if (b := part.bounding_box())]
        assert len(boxes) == 4
        assert all(b["x"] >= 0 and b["x"] + b["width"] <= width + 0.5 for b in boxes)
        assert not [(a, b) for i, a in enumerate(boxes) for b in boxes[i + 1 :] if _overlap(a, b)]


def _faults(page: Page) -> list[str]:
    """What axe finds, as 'rule: element'."""
    page.add_script_tag(path=AXE)
    found = page.evaluate("async () => (await axe.run()).violations")
    return [f"{fault['id']}: {node['html']} {node['failureSummary']}" for fault in found for node in fault["nodes"]]


def _overlap(a: dict[str, float], b: dict[str, float]) -> bool:
    def shared(start: str, size: str) -> float:
        return min(a[start] + a[size], b[start] + b[size]) - max(a[start], b[start])

    return shared("x", "width") > 1 and shared("y", "height") > 1
