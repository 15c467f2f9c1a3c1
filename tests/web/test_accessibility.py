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
    page.keyboard.press("e")
    page.get_by_role("button", name="Edit node 0").click()
    expect(page.get_by_role("list", name="Marks of node 0")).to_be_visible()
    page.get_by_role("button", name="Make boundary").click()
    expect(page.get_by_role("list", name="To mend")).to_be_visible()
    assert _faults(page) == []
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    assert _faults(page) == []

    page.goto(server.page(f"scan.html#{session}"))
    expect(page.get_by_role("button", name="Use this device's sensors")).to_be_visible()
    assert _faults(page) == []


def _faults(page: Page) -> list[str]:
    """What axe finds, as 'rule: element'."""
    page.add_script_tag(path=AXE)
    found = page.evaluate("async () => (await axe.run()).violations")
    return [f"{fault['id']}: {node['html']} {node['failureSummary']}" for fault in found for node in fault["nodes"]]
