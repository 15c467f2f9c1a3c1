"""The list of sessions: pictures of what is in them, and files that become one."""

from pathlib import Path

from playwright.sync_api import Page, expect

from tests.web.support import Server
from tracemesh.formats.rawnet import write_rawnet
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan


def test_a_network_is_opened_and_becomes_a_surface(server: Server, page: Page, shared_data: Path) -> None:
    page.goto(server.page())
    page.locator("input[type=file]").set_input_files(shared_data / "networks" / "field-2.network.json")
    expect(page.get_by_label("Name of the session")).to_have_value("field-2")
    expect(page.locator("canvas")).to_have_attribute("data-surface", "shown")
    curves = page.get_by_role("complementary", name="Curves and nodes")
    expect(curves.get_by_role("button", name="boundary").first).to_be_visible()
    expect(page.get_by_role("link", name="Network (JSON)")).to_be_visible()
    curves.get_by_role("button", name="boundary").first.click()
    expect(curves.get_by_role("button", name="Remove")).to_be_hidden()


def test_a_network_is_dropped_onto_the_list(server: Server, page: Page, shared_data: Path) -> None:
    page.goto(server.page())
    text = (shared_data / "networks" / "lilium-2.network.json").read_text()
    page.evaluate(
        """([name, text]) => {
          const data = new DataTransfer();
          data.items.add(new File([text], name));
          window.dispatchEvent(new DragEvent("drop", { dataTransfer: data, cancelable: true }));
        }""",
        ["lilium-2.network.json", text],
    )
    expect(page.get_by_label("Name of the session")).to_have_value("lilium-2")
    expect(page.locator("canvas")).to_have_attribute("data-surface", "shown")


def test_a_network_that_is_none_leaves_no_session(server: Server, page: Page, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.network.json"
    wrong.write_text('{"format": "tracemesh-network", "version": 2}')
    page.goto(server.page())
    before = server.call("GET", "/sessions")
    page.locator("input[type=file]").set_input_files(wrong)
    expect(page.get_by_role("alert")).to_contain_text("wrong.network.json was not opened: version")
    assert server.call("GET", "/sessions") == before


def test_the_list_shows_what_is_in_each_session(server: Server, page: Page, tmp_path: Path) -> None:
    scan = tmp_path / "leaf.rawnet"
    scan.write_text(write_rawnet(exact_scan(leaf(), 0.01)))
    server.call("POST", "/sessions", {"name": "Bare"})
    page.goto(server.page())
    page.locator("input[type=file]").set_input_files(scan)
    expect(page.get_by_label("Name of the session")).to_have_value("leaf")
    page.get_by_role("link", name="tracemesh").click()
    sessions = page.get_by_role("list", name="Sessions").get_by_role("listitem")
    expect(sessions.filter(has_text="leaf").locator("svg path")).to_have_count(5)
    bare = sessions.filter(has_text="Bare")
    expect(bare).to_contain_text("nothing scanned yet")
    expect(bare.locator("svg path")).to_have_count(0)
