"""The session's page tells which calibration is in use, and lets a person choose; nothing is applied by itself."""

import urllib.request

from playwright.sync_api import Page, expect

from tests.web.support import Server
from tracemesh.formats.recordings import recording_from_simulation, write_recording
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import plan_scan, simulate_scan


def test_a_calibration_is_proposed_chosen_and_given_up(server: Server, page: Page) -> None:
    session = server.call("POST", "/sessions", {"name": "Leaf"})["id"]
    path = f"/sessions/{session}/recordings"
    content = write_recording(recording_from_simulation(simulate_scan(plan_scan(leaf())), "leaf")).encode()
    urllib.request.urlopen(f"http://{server.address}/api/v1{path}", content).close()
    page.goto(server.page(f"#/sessions/{session}"))
    expect(page.get_by_role("button", name="Reconstruct")).to_be_enabled()
    expect(page.get_by_role("heading", name="Calibration")).to_be_hidden()

    calibration = {"device": "simulated", "made": "2026-05-03T10:00:00Z", "place": "the lab", "circumference": 0.2}
    server.call("POST", "/devices/simulated/calibrations", {"calibration": calibration})
    page.reload()
    expect(page.get_by_text("Calibration 1 is available; it is not used.")).to_be_visible()
    choice = page.get_by_label("simulated")
    expect(choice).to_have_value("")
    choice.select_option("1")
    expect(page.get_by_text("it is not used")).to_be_hidden()
    assert [r["calibration"] for r in server.call("GET", path)] == [1]
    page.reload()
    expect(choice).to_have_value("1")
    expect(choice.get_by_role("option", selected=True)).to_contain_text("1: ")
    expect(choice.get_by_role("option", selected=True)).to_contain_text("2026, the lab")
    choice.select_option("")
    expect(page.get_by_text("it is not used")).to_be_visible()
    assert [r["calibration"] for r in server.call("GET", path)] == [None]
