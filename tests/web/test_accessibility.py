"""No page has a fault that axe can find, in either theme; what is shown only meanwhile is looked at elsewhere."""

import itertools
from collections.abc import Callable

from playwright.sync_api import Page, expect

from tests.web.axe import faults
from tests.web.support import Rider, Server


def test_pages_are_accessible(server: Server, page: Page, rider: Callable[[str], Rider]) -> None:
    session = server.call("POST", "/sessions", {"name": "Leaf"})["id"]
    empty = server.call("POST", "/sessions", {"name": "Empty"})["id"]
    rider(session).ride(lambda m: False)
    server.call("POST", f"/sessions/{session}/reconstructions", {})
    page.goto(server.page())
    expect(page.get_by_role("link", name="Leaf")).to_be_visible()
    assert faults(page) == []

    page.goto(server.page(f"#/sessions/{empty}"))
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    assert faults(page) == []

    page.goto(server.page(f"#/sessions/{session}"))
    expect(page.locator("canvas").first).to_have_attribute("data-surface", "shown")
    page.get_by_role("button", name="2 interior").click()
    page.get_by_text("Parameters").click()
    page.get_by_label("Mean curvature").check()
    page.get_by_label("Curvature along a curve").check()
    expect(page.get_by_role("heading", name="Curvature along curve 2")).to_be_visible()
    assert faults(page) == []
    page.keyboard.press("e")
    page.get_by_role("button", name="Edit node 0").click()
    expect(page.get_by_role("list", name="Marks of node 0")).to_be_visible()
    page.get_by_role("button", name="Make boundary").click()
    expect(page.get_by_role("list", name="To mend")).to_be_visible()
    assert faults(page) == []
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    assert faults(page) == []

    page.goto(server.page(f"scan.html#{session}"))
    expect(page.get_by_role("button", name="Use this device's sensors")).to_be_visible()
    assert faults(page) == []


STOPS = """() => {
  const reachable = "a[href], button, input, select, summary, [tabindex='0']";
  const seen = [...document.querySelectorAll(reachable)].filter((e) => !e.disabled && e.checkVisibility());
  const own = (e) => (e.type === "radio" ? e.name : e);
  return new Set(seen.map(own)).size;
}"""
"""Counts what the keyboard should reach; of radio buttons that exclude each other one."""
FOCUSED = """() => {
  const e = document.activeElement;
  if (e === document.body) return undefined;
  const { x, y, width, height } = e.getBoundingClientRect();
  const part = ["header", ".left", "main", ".right"].find((area) => e.closest(area));
  const outlined = getComputedStyle(e).outlineStyle !== "none" && e.matches(":focus-visible");
  const down = y + height / 2 + scrollY + (e.closest("aside")?.scrollTop ?? 0);
  return { part, middle: [x + width / 2, down], label: e.ariaLabel ?? e.textContent.trim(), outlined };
}"""


ORDERS = {
    (1280, 720): ["header", ".left", "main", ".right"],
    (820, 1180): ["header", "main", ".left", ".right"],
    (390, 780): ["header", "main", ".left", ".right"],
}
"""Parts of the page in the order in which they are seen, by the size of the window."""


def test_the_keyboard_reaches_everything_in_reading_order(server: Server, page: Page, rider: Callable) -> None:
    session = server.call("POST", "/sessions", {"name": "Leaf, by key"})["id"]
    rider(session).ride(lambda m: False)
    server.call("POST", f"/sessions/{session}/reconstructions", {})
    for (width, height), order in ORDERS.items():
        page.set_viewport_size({"width": width, "height": height})
        page.goto("about:blank")
        page.goto(server.page(f"#/sessions/{session}"))
        expect(page.locator("canvas").first).to_have_attribute("data-surface", "shown")
        expect(page.get_by_role("button", name="5 interior")).to_be_visible()
        expect(page.get_by_role("button", name="Edit nodes")).to_be_enabled()
        expect(page.get_by_role("button", name="Edit node 10")).to_be_visible()
        _check_order(page, order)
    _check_sheet(page)


def _check_order(page: Page, order: list[str]) -> None:
    reached = []
    while page.keyboard.press("Tab") or (at := page.evaluate(FOCUSED)):
        reached.append(at)
    assert len(reached) == page.evaluate(STOPS)
    assert [at["label"] for at in reached if not at["outlined"]] == []
    assert [part for part, _ in itertools.groupby(at["part"] for at in reached)] == order
    for before, at in itertools.pairwise(reached):
        lower, right = at["middle"][1] > before["middle"][1] - 8, at["middle"][0] > before["middle"][0]
        assert lower or right, f"from {before['label']} back to {at['label']}"


def _check_sheet(page: Page) -> None:
    """The sheet of keys keeps the focus while it is open, and gives it back."""
    opener = page.get_by_role("button", name="Keyboard shortcuts")
    opener.focus()
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_be_visible()
    for _ in range(3):
        page.keyboard.press("Tab")
        assert page.evaluate("() => !document.activeElement.closest('header, main, aside')")
    page.keyboard.press("Escape")
    expect(opener).to_be_focused()
