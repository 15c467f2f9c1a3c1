"""On every size that people have, no panel covers another and the view is never blank."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.web.support import Rider, Server, share_of_pixels

SIZES = {"laptop": (1280, 720), "small": (1024, 768), "tablet": (820, 1180), "desk": (1920, 1080), "phone": (390, 780)}
PANELS = "header, aside, main, .strip"
FLOATING = "main > .tools, main > figure, main > .problem, main > .scale"
BOXES = """(group) =>
  [...document.querySelectorAll(group)].map((e) => e.getBoundingClientRect().toJSON()).filter((box) => box.height)"""
"""All in the same moment: a panel grows when something comes in."""
FITS = """() => {
  const canvas = document.querySelector("main > canvas");
  const fits = canvas.width === canvas.clientWidth && canvas.height === canvas.clientHeight;
  return fits && !document.querySelector(".strip");
}"""
"""The plot is closed, and the view has taken its place."""
SEEN_WHOLE = """() => {
  const view = document.querySelector("main > canvas").getBoundingClientRect();
  const nodes = [...document.querySelectorAll("circle.node")].map((node) => node.getBoundingClientRect());
  const [across, down] = [nodes.map(({ x }) => x), nodes.map(({ y }) => y)];
  const inside = (places, low, high) => Math.min(...places) > low && Math.max(...places) < high;
  const filled = (places, size) => Math.max(...places) - Math.min(...places) > size / 2;
  return (
    inside(across, view.left, view.right) && inside(down, view.top, view.bottom) &&
    (filled(across, view.width) || filled(down, view.height))
  );
}"""
"""All nodes are in the view, and fill it one way or the other."""
NODES = """() => [...document.querySelectorAll("circle.node")].map((node) =>
  [node.cx, node.cy].map((at) => at.baseVal.value),
)"""


@pytest.fixture(scope="module")
def leaf_session(server: Server) -> dict[str, str]:
    """Filled by the first test that needs it."""
    return {}


@pytest.mark.parametrize("size", SIZES)
def test_nothing_covers_anything(
    server: Server, page: Page, rider: Callable[[str], Rider], leaf_session: dict[str, str], size: str
) -> None:
    if not leaf_session:
        leaf_session["id"] = server.call("POST", "/sessions", {"name": "A leaf with quite a long name"})["id"]
        rider(leaf_session["id"]).ride(lambda m: False)
        leaf_session["empty"] = server.call("POST", "/sessions", {"name": ""})["id"]
        server.call("POST", f"/sessions/{leaf_session['id']}/reconstructions", {})
    width, height = SIZES[size]
    page.set_viewport_size({"width": width, "height": height})

    page.goto(server.page())
    expect(page.get_by_role("link", name="A leaf with quite a long name")).to_be_visible()
    _check(page, width)
    page.goto(server.page(f"#/sessions/{leaf_session['empty']}"))
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    _check(page, width)

    page.goto(server.page(f"#/sessions/{leaf_session['id']}"))
    view = page.locator("main > canvas")
    expect(view).to_have_attribute("data-surface", "shown")
    expect(page.get_by_role("button", name="5 interior")).to_be_visible()
    _check(page, width)
    for key in ("e", "]", ".", "b", "p"):  # all that may be open at once
        page.keyboard.press(key)
    expect(page.get_by_role("img", name="Gauss map")).to_be_visible()
    expect(page.get_by_role("heading", name="Curvature along curve")).to_be_visible()
    expect(page.get_by_role("slider", name="Place on curve 1")).to_be_visible()
    _check(page, width)
    page.keyboard.press("p")
    page.wait_for_function(FITS)  # what is seen whole is so in a view of this size
    page.keyboard.press("0")
    page.wait_for_timeout(300)
    _check_gauss_map(page)
    boundary, background = share_of_pixels(view, "curve-boundary", "view")
    assert boundary > 0.0005
    assert background < 0.995


def _check_gauss_map(page: Page) -> None:
    """It covers nothing of the object, seen whole: behind it there is only the background."""
    page.get_by_label("Grid").uncheck()
    figure = page.locator("main > figure")
    figure.evaluate("figure => (figure.style.opacity = 0)")
    for _ in range(100):  # until the view has come to rest
        if share_of_pixels(figure, "view")[0] > 0.999:
            return
        page.wait_for_timeout(100)
    raise AssertionError("something of the object lies behind the Gauss map")


def _check(page: Page, width: int) -> None:
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for group in (PANELS, FLOATING):
        boxes = page.evaluate(BOXES, group)
        assert all(b["x"] >= -0.5 and b["x"] + b["width"] <= width + 0.5 for b in boxes)
        assert not [(a, b) for i, a in enumerate(boxes) for b in boxes[i + 1 :] if _overlap(a, b)]


def _overlap(a: dict[str, float], b: dict[str, float]) -> bool:
    def shared(start: str, size: str) -> float:
        return min(a[start] + a[size], b[start] + b[size]) - max(a[start], b[start])

    return shared("x", "width") > 1 and shared("y", "height") > 1


def test_what_was_seen_whole_stays_so_in_a_view_of_another_size(
    server: Server, page: Page, rider: Callable[[str], Rider]
) -> None:
    session = server.call("POST", "/sessions", {"name": "Leaf"})["id"]
    rider(session).ride(lambda m: False)
    page.goto(server.page(f"#/sessions/{session}"))
    expect(page.locator("circle.node")).to_have_count(11)
    for width, height in ((700, 700), (1600, 500)):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_function(SEEN_WHOLE)

    page.locator("main > canvas").hover(position={"x": 200, "y": 200})
    seen = page.evaluate(NODES)
    page.mouse.wheel(0, -120)  # the camera is in somebody's hands now
    page.wait_for_function(f"(seen) => String(({NODES})()) !== String(seen)", arg=seen)
    page.wait_for_timeout(500)
    seen = page.evaluate(NODES)
    page.set_viewport_size({"width": 1300, "height": 500})
    page.wait_for_function(f"(seen) => String(({NODES})()) !== String(seen)", arg=seen)
    page.wait_for_timeout(500)
    heights = [[y for _, y in nodes] for nodes in (seen, page.evaluate(NODES))]
    assert heights[1] == pytest.approx(heights[0], abs=1)
