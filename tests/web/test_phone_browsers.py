"""What browsers of phones ask for and give: a lit screen, vibration, and the orientation as iOS tells it.

iOS is what its documentation says of it, defined in Chromium before the page loads; no iPhone takes part.
"""

import numpy as np
from playwright.sync_api import Page, expect

from tests.web.conftest import SENSORS
from tests.web.phone import Hand, reconstructed, roundness
from tests.web.support import Server

NOTE_CALLS = """() => {
  const vibrate = navigator.vibrate.bind(navigator);
  navigator.vibrate = (pattern) => (note("vibrate"), vibrate(pattern));
  const request = navigator.wakeLock.request.bind(navigator.wakeLock);
  navigator.wakeLock.request = async (kind) => {
    const lock = (window.held = await request(kind));
    note(`${kind} kept on`);
    lock.addEventListener("release", () => note("let go"));
    return lock;
  };
}"""
"""Tells the test what the page asks of the browser, which still does it."""


def test_the_screen_is_kept_on_and_marks_are_felt(server: Server, phone: Page) -> None:
    session = server.call("POST", "/sessions", {"name": "Awake"})["id"]
    noted: list[str] = []
    phone.context.grant_permissions([*SENSORS, "screen-wake-lock"])
    phone.expose_function("note", lambda what: noted.append(what))
    phone.add_init_script(f"({NOTE_CALLS})()")
    hand = Hand(phone)
    hand.hold(0)
    phone.goto(server.page(f"scan.html#{session}"))
    phone.get_by_role("button", name="Use this device's sensors").click()
    hand.lead(0, 0.01)
    phone.get_by_role("button", name="Start curve").click()
    _await(phone, noted, ["screen kept on"])
    hand.lead(0.01, 0.02)
    phone.get_by_role("button", name="Mark node").click()
    _await(phone, noted, ["screen kept on", "vibrate"])
    phone.evaluate(HIDE)
    _await(phone, noted, ["screen kept on", "vibrate", "let go"])
    phone.evaluate(SHOW)
    _await(phone, noted, ["screen kept on", "vibrate", "let go", "screen kept on"])
    phone.get_by_role("button", name="Stop curve").click()
    phone.get_by_role("button", name="Done").click()
    _await(phone, noted, ["screen kept on", "vibrate", "let go", "screen kept on", "let go"])


HIDE = """() => {
  Object.defineProperty(document, "visibilityState", { configurable: true, value: "hidden" });
  document.dispatchEvent(new Event("visibilitychange"));
  return held.release();
}"""
"""What happens when somebody switches to another app: no headless window can be hidden."""
SHOW = """() => {
  delete document.visibilityState;
  document.dispatchEvent(new Event("visibilitychange"));
}"""


def _await(phone: Page, noted: list[str], wanted: list[str]) -> None:
    for _ in range(200):
        if noted == wanted:
            return
        phone.wait_for_timeout(50)
    assert noted == wanted


IOS = """(answer) => {
  delete window.AbsoluteOrientationSensor;
  delete window.ondeviceorientationabsolute;
  DeviceOrientationEvent.requestPermission = async () => (navigator.userActivation.isActive ? answer : "denied");
  const turn = 4000;
  let begin;
  const button = (name) => [...document.querySelectorAll("button")].find((e) => e.textContent.trim() === name);
  window.lead = () => button("Start curve").click();
  setInterval(() => {
    const stop = button("Stop curve");
    if (stop) begin ??= performance.now();
    const heading = begin === undefined ? 0 : (360 * (performance.now() - begin)) / turn;
    if (heading > 350) return stop?.click();
    const event = new DeviceOrientationEvent("deviceorientation", { alpha: (437 - heading) % 360, beta: 0, gamma: 0 });
    window.dispatchEvent(Object.defineProperty(event, "webkitCompassHeading", { value: heading }));
  }, 16);
}"""
"""A phone flat on a table that turns right, from North, once it records; its angles begin anywhere, only its compass
knows North."""


def test_an_iphone_is_asked_in_a_tap_and_led_by_its_compass(server: Server, phone: Page) -> None:
    session = server.call("POST", "/sessions", {"name": "By compass"})["id"]
    phone.add_init_script(f"({IOS})('granted')")
    phone.goto(server.page(f"scan.html#{session}"))
    phone.get_by_role("button", name="Use this device's sensors").click()
    expect(phone.get_by_role("button", name="Start curve")).to_be_visible()
    phone.evaluate("lead()")
    expect(phone.get_by_role("button", name="Stop curve")).to_be_visible()
    expect(phone.get_by_role("button", name="Start curve")).to_be_visible()
    phone.get_by_role("button", name="Done").click()
    phone.wait_for_url(f"**/#/sessions/{session}")
    points = reconstructed(server, session)
    assert roundness(points) < 0.1
    begin = points[1] - points[0]
    assert begin @ [0, 1, 0] > 0.95 * np.linalg.norm(begin), "it sets out to the North"
    assert points[:, 0].mean() > points[0, 0], "and turns to the East"


def test_a_refusal_on_an_iphone_is_told(server: Server, phone: Page) -> None:
    session = server.call("POST", "/sessions", {"name": "Refused"})["id"]
    phone.add_init_script(f"({IOS})('denied')")
    phone.goto(server.page(f"scan.html#{session}"))
    phone.get_by_role("button", name="Use this device's sensors").click()
    expect(phone.get_by_role("alert")).to_contain_text("may not read the motion sensors")
