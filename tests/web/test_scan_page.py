"""A browser that scans: its own orientation sensor led along a known curve, and a Morphorider on its serial port."""

import json
import re
import time
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.web.axe import faults
from tests.web.conftest import CHROMIUM, FLAGS, SENSORS
from tests.web.phone import Hand, reconstructed, roundness
from tests.web.support import PATIENCE, Server, free_port, running_server
from tracemesh_bridge.framing import Frame, FrameLayout, encode

TICKS_PER_FRAME = 8


def test_a_circle_scanned_by_phone_survives_the_death_of_the_server(phone: Page, tmp_path: Path) -> None:
    port = free_port()
    with running_server(tmp_path, port) as server:
        server.await_health()
        session = server.call("POST", "/sessions", {"name": "By phone"})["id"]
        hand = Hand(phone)
        hand.hold(0)
        phone.goto(server.page(f"scan.html#{session}"))
        phone.get_by_role("button", name="Use this device's sensors").click()
        hand.lead(0, 0.01)
        phone.get_by_role("button", name="Start curve").click()
        hand.lead(0.01, 0.02)
        phone.get_by_role("button", name="Mark node").click()
        expect(phone.get_by_role("button", name="Undo node 0")).to_be_enabled()
        hand.lead(0.02, 2)
    hand.lead(2, 3)
    assert phone.get_by_role("status").inner_text().startswith(("no connection", "connecting"))
    with running_server(tmp_path, port) as server:
        hand.lead(3, 2 * np.pi)
        server.await_health()
        phone.get_by_role("button", name="where it began").click()
        phone.get_by_role("button", name="Stop curve").click()
        expect(phone.get_by_role("status")).to_have_text("live")
        phone.get_by_role("button", name="Done").click()
        expect(phone).to_have_url(re.compile(f"#/sessions/{session}$"))
        (curve,) = server.call("GET", f"/sessions/{session}/curves")
        assert (curve["boundary"], curve["closed"], curve["ended"]) == (True, True, True)
        assert [mark["node"] for mark in curve["marks"]] == [0]
        points = reconstructed(server, session)
    assert roundness(points) < 0.05


def test_a_shape_is_drawn_in_the_air(server: Server, phone: Page) -> None:
    """Two strokes: half a circle, and the other half back to where the first began; a third one is taken back."""
    session = server.call("POST", "/sessions", {"name": "In the air"})["id"]
    hand = Hand(phone)
    hand.hold(0)
    phone.goto(server.page(f"scan.html#{session}"))
    phone.get_by_role("button", name="Use this device's sensors").click()
    hand.lead(0, 0.01)
    phone.get_by_role("button", name="in the air").click()
    expect(phone.get_by_role("button", name="Hold to draw")).to_be_visible()
    assert faults(phone) == []
    draw(phone, hand, 0, np.pi)
    ends = phone.get_by_role("group", name="Node where the stroke ends")
    ends.get_by_role("button", name="0", exact=True).click()
    draw(phone, hand, np.pi, 2 * np.pi)
    draw(phone, hand, 0, 0.5)
    expect(phone.get_by_role("button", name="Undo last curve")).to_be_enabled()
    phone.get_by_role("button", name="Undo last curve").click()
    give_up = time.monotonic() + PATIENCE
    while len(curves := server.call("GET", f"/sessions/{session}/curves")) > 2 and time.monotonic() < give_up:
        time.sleep(0.1)
    assert [[mark["node"] for mark in curve["marks"]] for curve in curves] == [[0, 1], [1, 0]]
    assert not any(curve["boundary"] for curve in curves)
    assert roundness(reconstructed(server, session)) < 0.1
    scan = server.call("GET", f"/sessions/{session}/recordings")
    assert [recording["device"]["wheel"] for recording in scan] == [None], "lengths come from time alone"


def draw(phone: Page, hand: Hand, start: float, end: float) -> None:
    """Hold the pad while the phone is led over a part of the circle."""
    hand.hold(start)
    pad = phone.get_by_role("button", name="Hold to draw")
    pad.hover()
    phone.mouse.down()
    expect(phone.get_by_role("button", name="Drawing: let go to end")).to_be_visible()
    hand.lead(start, end)
    phone.mouse.up()
    expect(pad).to_be_visible()


SERIAL_PORT = """(frames) => {
  let controller, next = 0;
  const bytes = (hex) => Uint8Array.from(hex.match(/../g), (pair) => parseInt(pair, 16));
  const frame = () => bytes(frames[Math.min(next++, frames.length - 1)]);
  const port = {
    open: async () => {},
    close: async () => {},
    readable: new ReadableStream({ start: (given) => (controller = given) }),
    writable: new WritableStream({ write: () => controller.enqueue(frame()) }),
  };
  Object.defineProperty(navigator, "serial", { value: { requestPort: async () => port } });
}"""
"""A port of the browser that answers each request with the next frame."""


def test_a_morphorider_is_read_without_a_bridge(server: Server, page: Page) -> None:
    session = server.call("POST", "/sessions", {"name": "By serial port"})["id"]
    page.add_init_script(f"({SERIAL_PORT})({json.dumps(_frames())})")
    page.goto(server.page(f"scan.html#{session}"))
    page.get_by_role("button", name="Connect a Morphorider").click()
    page.get_by_role("button", name="boundary").click()
    page.get_by_role("button", name="Start curve").click()
    expect(page.get_by_text(re.compile(r"^[1-9]\d\d samples$"))).to_be_visible()
    assert faults(page) == []
    page.get_by_role("button", name="Stop curve").click()
    page.get_by_role("button", name="Done").click()
    expect(page).to_have_url(re.compile(f"#/sessions/{session}$"))
    (curve,) = server.call("GET", f"/sessions/{session}/curves")
    assert curve["boundary"]
    assert curve["samples"] >= 100
    expected = (curve["samples"] - 1) * TICKS_PER_FRAME / 500 * 0.1
    assert curve["length"] == pytest.approx(expected, rel=0.02)


def _frames() -> list[str]:
    """A Morphorider that rolls steadily on a table to the North, in hex."""
    layout = FrameLayout()
    up, north_and_down = (0.0, 0.5, 0.0), (0.25, -0.433, 0.0)
    ticks = (divmod(TICKS_PER_FRAME * i, 500) for i in range(3000))
    return [encode(layout, Frame((big, small), up, north_and_down)).hex() for big, small in ticks]


def test_a_refused_permission_is_told(server: Server, browser: Browser) -> None:
    session = server.call("POST", "/sessions", {"name": "Refused"})["id"]
    context = browser.new_context(viewport={"width": 390, "height": 780}, permissions=[])
    page = context.new_page()
    devtools = context.new_cdp_session(page)
    for sensor in SENSORS:
        devtools.send("Browser.setPermission", {"permission": {"name": sensor}, "setting": "denied"})
    page.goto(server.page(f"scan.html#{session}"))
    page.get_by_role("button", name="Use this device's sensors").click()
    expect(page.get_by_role("alert")).to_contain_text("may not read the motion sensors")
    expect(page.get_by_role("status")).to_have_text("live")
    expect(page.get_by_text("screen lock")).to_be_hidden()
    context.close()


def test_a_page_without_https_says_what_is_missing(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name that is not this machine's own, over plain HTTP and with a token: what a phone on the network sees."""
    monkeypatch.setenv("TRACEMESH_TOKEN", "a-secret-of-this-test")
    port = free_port()
    flags = [*FLAGS, "--host-resolver-rules=MAP lab.test 127.0.0.1"]
    plain = browser.browser_type.launch(executable_path=CHROMIUM, args=flags)
    with running_server(tmp_path, port) as server:
        server.await_health()
        page = plain.new_page(viewport={"width": 390, "height": 844})
        page.goto(f"http://lab.test:{port}/?token=a-secret-of-this-test")
        page.get_by_label("Name of the new session").fill("Plain")
        page.get_by_role("button", name="New session").click()
        expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
        page.goto(f"http://lab.test:{port}/scan.html#{page.url.rsplit('/', 1)[1]}")
        assert page.evaluate("window.isSecureContext") is False
        page.get_by_role("button", name="Use this device's sensors").click()
        expect(page.get_by_role("alert")).to_contain_text("HTTPS")
    plain.close()
