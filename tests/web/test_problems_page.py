"""What keeps a network from being one is shown where it is, and a button mends it."""

from pathlib import Path

from playwright.sync_api import Page, expect

from tests.web.support import Server


def test_problems_are_shown_where_they_are_and_mended(server: Server, page: Page, shared_data: Path) -> None:
    page.goto(server.page())
    page.locator("input[type=file]").set_input_files(shared_data / "lilium.rawnet")
    expect(page.get_by_role("button", name="Edit nodes")).to_be_visible()
    expect(page.get_by_role("list", name="To mend")).to_be_hidden()
    page.get_by_role("button", name="2 interior").click()
    page.get_by_role("button", name="Make boundary").click()
    problems = page.get_by_role("list", name="To mend").get_by_role("listitem")
    expect(problems).to_have_count(2)
    expect(problems.first).to_contain_text("of curve 2 is marked as boundary but has a face on both sides")
    expect(page.locator("main svg polyline.flag")).to_have_count(2)

    problems.first.get_by_role("button", name="Mark curve 2 as interior").click()
    expect(page.get_by_role("list", name="To mend")).to_be_hidden()
    expect(page.locator("main svg .flag")).to_have_count(0)
    page.get_by_role("button", name="Undo").click()
    expect(problems).to_have_count(2)
    session = page.url.rsplit("/", 1)[1]
    assert server.call("GET", f"/sessions/{session}/curves")[1]["boundary"] is True


def test_curves_that_meet_nowhere_ask_for_their_nodes(server: Server, page: Page, shared_data: Path) -> None:
    page.goto(server.page())
    page.locator("input[type=file]").set_input_files(shared_data / "lilium.rawnet")
    expect(page.get_by_role("button", name="Edit nodes")).to_be_visible()
    session = page.url.rsplit("/", 1)[1]
    server.call("PATCH", f"/sessions/{session}/curves/2", {"marks": []})
    page.get_by_role("button", name="Find where curves meet").click()
    expect(
        page.get_by_role("list", name="Proposed nodes").or_(page.get_by_text("No more nodes were found."))
    ).to_be_visible()
