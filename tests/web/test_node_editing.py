"""Nodes are marked, moved, joined, split and deleted in the 3D view and by key; everything can be taken back."""

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.web.support import Rider, Server

Marks = list[list[tuple[int, int]]]


@pytest.fixture
def session(server: Server, page: Page, shared_data: Path) -> str:
    """The thesis author's scan, opened in the page, with nodes ready to be edited."""
    page.goto(server.page())
    page.locator("input[type=file]").set_input_files(shared_data / "lilium.rawnet")
    expect(page.get_by_role("button", name="Edit nodes")).to_be_visible()
    expect(_nodes(page)).to_have_count(5)
    _settled(page)
    page.keyboard.press("e")
    expect(page.get_by_text("Click a curve to mark a node.")).to_be_visible()
    return page.url.rsplit("/", 1)[1]


def test_a_click_on_a_curve_marks_a_node(server: Server, page: Page, session: str) -> None:
    before = _marks(server, session)
    _find_curve_near(page, _place(page, 3))
    page.mouse.down()
    page.mouse.up()
    expect(_nodes(page)).to_have_count(6)
    expect(page.get_by_text("Node 5 marked")).to_be_visible()
    after = _marks(server, session)
    added = [mark for old, new in zip(before, after, strict=True) for mark in new if mark not in old]
    assert [node for _, node in added] == [5]
    page.keyboard.press("u")
    expect(_nodes(page)).to_have_count(5)
    assert _marks(server, session) == before


def test_a_node_is_drawn_along_its_curve(server: Server, page: Page, session: str) -> None:
    before, (x, y) = _marks(server, session), _place(page, 3)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 12, y + 4, steps=3)
    page.mouse.move(x + 30, y + 8, steps=5)
    expect(page.locator("svg .cursor")).to_be_visible()
    assert _marks(server, session) == before  # only tried so far
    page.mouse.up()
    expect(page.get_by_text("Node 3 moved")).to_be_visible()
    after = _marks(server, session)
    moved = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    assert len(moved) == 1
    assert [node for _, node in moved[0][0]] == [node for _, node in moved[0][1]]
    page.keyboard.press("u")
    expect(page.get_by_text("Node 3 moved")).to_be_hidden()
    assert _marks(server, session) == before
    page.keyboard.press("y")
    expect(page.get_by_text("Node 3 moved")).to_be_visible()
    assert _marks(server, session) == after


def test_a_node_dropped_on_another_joins_it_and_is_split_off_again(server: Server, page: Page, session: str) -> None:
    before = _marks(server, session)
    _hold_over(page, 1, 4)
    page.mouse.up()
    expect(_nodes(page)).to_have_count(4)
    joined = _marks(server, session)
    assert joined == [[(s, 4 if n == 1 else n) for s, n in marks] for marks in before]

    places = page.get_by_role("list", name="Marks of node 4").get_by_role("listitem")
    expect(places).to_have_count(sum(node == 4 for marks in joined for _, node in marks))
    places.filter(has_text="on curve 2").get_by_role("button", name="Split off").first.click()
    expect(_nodes(page)).to_have_count(5)
    page.keyboard.press("u")
    page.keyboard.press("u")
    expect(page.get_by_role("button", name="Undo")).to_be_hidden()
    assert _marks(server, session) == before


def test_the_same_by_key(server: Server, page: Page, session: str) -> None:
    before = _marks(server, session)
    page.keyboard.press("]")
    page.keyboard.press("]")
    expect(page.get_by_role("slider", name="Place on curve 2")).to_be_visible()
    for _ in range(6):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("a")
    expect(page.get_by_text("Node 5 marked")).to_be_visible()
    expect(_nodes(page)).to_have_count(6)
    page.keyboard.press(",")
    expect(page.get_by_role("button", name="Edit node 5")).to_have_attribute("aria-pressed", "true")
    (sample,) = [s for s, n in _marks(server, session)[1] if n == 5]
    page.keyboard.press("ArrowRight")
    expect(page.get_by_text("Node 5 moved")).to_be_visible()
    assert (sample + 1, 5) in _marks(server, session)[1]
    page.keyboard.press("Delete")
    expect(page.get_by_text("Node 5 deleted")).to_be_visible()
    assert _marks(server, session) == before
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Edit nodes")).to_have_attribute("aria-pressed", "false")


def test_the_surface_follows_an_edit(server: Server, page: Page, session: str) -> None:
    page.keyboard.press("r")
    view = page.locator("canvas")
    expect(view).to_have_attribute("data-surface", "shown")
    page.keyboard.press(".")
    page.keyboard.press("Shift+ArrowRight")
    expect(page.get_by_text("Node 0 moved")).to_be_visible()
    page.wait_for_function(
        """async (session) => {
          const jobs = await (await fetch(`/api/v1/sessions/${session}/reconstructions`)).json();
          return jobs.length === 2 && jobs[0].state === "done";
        }""",
        arg=session,
    )
    expect(view).to_have_attribute("data-surface", "shown")


def test_a_node_is_marked_where_the_device_is(server: Server, page: Page, rider: Callable[[str], Rider]) -> None:
    made = server.call("POST", "/sessions", {"name": "Leaf"})["id"]
    page.goto(server.page(f"#/sessions/{made}"))
    expect(page.get_by_text("No device is connected")).to_be_visible()
    rider(made).ride(lambda m: m["type"] == "samples" and m["first_sample"] >= 300)
    expect(page.get_by_role("button", name="Mark a node here")).to_be_visible()
    known = _nodes(page).count()
    page.keyboard.press(" ")
    expect(_nodes(page)).to_have_count(known + 1)
    page.keyboard.press("Numpad7")
    expect(page.get_by_role("button", name="Edit node 7")).to_be_visible()
    (curve,) = server.call("GET", f"/sessions/{made}/curves")
    assert {"sample": curve["samples"] - 1, "node": 7} in curve["marks"]


def test_a_measured_length_is_set_used_and_taken_back(server: Server, page: Page, session: str) -> None:
    page.get_by_role("button", name="2 interior").click()
    page.get_by_text("Measured lengths").click()
    segments = page.get_by_role("list", name="Segments of curve 2").get_by_role("listitem")
    expect(segments).to_have_count(2)
    expect(segments.first).to_contain_text("cm")
    segments.first.get_by_role("spinbutton").fill("120")
    page.keyboard.press("Enter")
    expect(page.get_by_text("measured: 1.20 m")).to_be_visible()
    expect(page.get_by_text("Measured lengths (1)")).to_be_visible()
    assert server.call("GET", f"/sessions/{session}/curves")[1]["lengths"][0]["length"] == 1.2
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_text("Measured lengths (1)")).to_be_hidden()
    assert server.call("GET", f"/sessions/{session}/curves")[1]["lengths"] == []


def _nodes(page: Page) -> Locator:
    return page.get_by_role("list", name="Marked nodes").get_by_role("listitem")


def _marks(server: Server, session: str) -> Marks:
    curves: list[dict[str, Any]] = server.call("GET", f"/sessions/{session}/curves")
    return [[(mark["sample"], mark["node"]) for mark in curve["marks"]] for curve in curves]


def _settled(page: Page) -> None:
    """Wait until the network is drawn and the camera stands still."""
    page.wait_for_function(
        """() => new Promise((resolve) => {
          const read = () => [...document.querySelectorAll("svg .node")].map((n) => n.getAttribute("cx")).join();
          const first = read();
          setTimeout(() => resolve(first !== "" && read() === first), 600);
        })"""
    )


def _place(page: Page, node: int) -> tuple[float, float]:
    """Where a node's dot is in the window once it rests, px."""
    place = _seen(page, node)
    while True:
        page.wait_for_timeout(400)
        before, place = place, _seen(page, node)
        if place == before:
            return place


def _seen(page: Page, node: int) -> tuple[float, float]:
    found = page.evaluate(
        """(node) => {
          const labels = [...document.querySelectorAll("main svg text")].map((t) => t.textContent);
          const dot = document.querySelectorAll("main svg .node")[labels.indexOf(String(node))];
          const box = dot.getBoundingClientRect();
          return [box.x + box.width / 2, box.y + box.height / 2];
        }""",
        node,
    )
    return found[0], found[1]


def _hold_over(page: Page, node: int, other: int) -> None:
    """Take a node to another one; once more if it had moved from under the pointer, which then turned the view."""
    for _ in range(10):
        start, end = _place(page, node), _place(page, other)
        page.mouse.move(*start)
        page.mouse.down()
        page.mouse.move(start[0] + 10, start[1], steps=2)
        page.mouse.move(*end, steps=6)
        with suppress(AssertionError):
            expect(page.get_by_text(f"{node} joins {other}")).to_be_visible(timeout=5000)
            return
        page.mouse.up()
    raise AssertionError(f"node {node} cannot be taken to node {other}")


def _find_curve_near(page: Page, place: tuple[float, float]) -> None:
    """Move the pointer around a node until it is at a curve."""
    for turn in range(24):
        angle = 2 * math.pi * turn / 24
        page.mouse.move(place[0] + 45 * math.cos(angle), place[1] + 45 * math.sin(angle))
        page.wait_for_timeout(60)
        if page.locator("svg .cursor").count():
            return
    raise AssertionError("no curve leaves the node")
