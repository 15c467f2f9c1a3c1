"""Sharing a session: the owner makes links, a viewer sees and cannot change, a phone records into this one alone."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.web.axe import faults
from tests.web.support import PATIENCE, Server, free_port, running_server

TOKEN = "correct-horse-battery-staple"
Enter = Callable[[str], Page]


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that demands a token."""
    with ExitStack() as stack:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("TRACEMESH_TOKEN", TOKEN)
            server = stack.enter_context(running_server(tmp_path_factory.mktemp("data"), free_port()))
        server.await_health()
        yield server


@pytest.fixture
def enter(browser: Browser) -> Iterator[Enter]:
    """Open an address in a browser of one's own."""
    contexts: list[BrowserContext] = []

    def enter(url: str) -> Page:
        contexts.append(browser.new_context(viewport={"width": 1280, "height": 720}, reduced_motion="reduce"))
        page = contexts[-1].new_page()
        page.set_default_timeout(1000 * PATIENCE)
        page.goto(url)
        return page

    expect.set_options(timeout=1000 * PATIENCE)
    yield enter
    for context in contexts:
        context.close()


@pytest.fixture
def session(closed: Server, enter: Enter, shared_data: Path) -> tuple[Page, str]:
    """The owner's page of a session with curves, and the session's identifier."""
    page = enter(closed.page(f"?token={TOKEN}"))
    scan = (shared_data / "lilium.rawnet").read_text()
    made = page.evaluate(
        """async (scan) => {
          const post = (path, body, type) =>
            fetch("/api/v1" + path, { method: "POST", body, headers: { "content-type": type } }).then((r) => r.json());
          const { id } = await post("/sessions", JSON.stringify({ name: "Lily" }), "application/json");
          await post(`/sessions/${id}/recordings`, scan, "text/plain");
          return id;
        }""",
        scan,
    )
    page.goto(closed.page(f"#/sessions/{made}"))
    expect(page.get_by_role("button", name="Share")).to_be_visible()
    return page, made


def link(page: Page, button: str) -> str:
    if page.get_by_role("button", name="Share").get_attribute("aria-expanded") == "false":
        page.get_by_role("button", name="Share").click()
    page.get_by_role("button", name=button).click()
    field = page.get_by_label("Link", exact=True)
    expect(field).to_be_visible()
    return field.input_value()


def test_a_viewer_sees_the_session_and_nothing_to_change_it_with(
    session: tuple[Page, str], enter: Enter, closed: Server
) -> None:
    owner, made = session
    viewer = enter(link(owner, "New link to look"))
    expect(viewer.get_by_text("1 boundary")).to_be_visible()
    assert viewer.url == closed.page(f"#/sessions/{made}")
    for name in ("Reconstruct", "Share", "Find unmarked nodes"):
        expect(owner.get_by_role("button", name=name).first).to_be_visible()
        expect(viewer.get_by_role("button", name=name)).to_have_count(0)
    viewer.get_by_role("button", name="1 boundary").click()
    expect(viewer.get_by_role("group", name="Edit curve 1")).to_have_count(0)
    assert faults(viewer) == []
    assert viewer.evaluate(f"fetch('/api/v1/sessions/{made}', {{method: 'DELETE'}}).then((r) => r.status)") == 403


def test_a_viewer_whose_link_ends_is_told(session: tuple[Page, str], enter: Enter) -> None:
    owner, _ = session
    viewer = enter(link(owner, "New link to look"))
    expect(viewer.get_by_text("1 boundary")).to_be_visible()
    owner.get_by_role("list", name="Let in").get_by_role("button", name="End").click()
    expect(viewer.get_by_text("what lets you in, has ended")).to_be_visible()


def test_a_phone_comes_in_by_a_code_that_opens_this_session_only(
    session: tuple[Page, str], enter: Enter, closed: Server
) -> None:
    owner, made = session
    scan = link(owner, "Let a phone scan")
    expect(owner.get_by_role("img", name="QR code of the scan page")).to_be_visible()
    assert faults(owner) == []
    phone = enter(scan)
    assert phone.url == closed.page(f"scan.html#{made}")
    expect(phone.get_by_role("heading", name="Lily")).to_be_visible()
    rights: dict[str, Any] = json.loads(phone.evaluate("fetch('/api/v1/rights').then((r) => r.text())"))
    assert (rights["role"], rights["session"]) == ("device", made)


def test_a_link_in_a_page_of_another_site_arrives(session: tuple[Page, str], enter: Enter, closed: Server) -> None:
    owner, _ = session
    shared = link(owner, "New link to look")
    elsewhere = enter("data:text/html,<a href='about:blank'>mail</a>")
    elsewhere.evaluate("(url) => (document.querySelector('a').href = url)", shared)
    elsewhere.get_by_role("link").click()
    expect(elsewhere.get_by_text("1 boundary")).to_be_visible()


def test_what_only_this_machine_reaches_says_how_to_be_shared(server: Server, page: Page) -> None:
    made = server.call("POST", "/sessions", {"name": "Mine"})["id"]
    page.goto(server.page(f"#/sessions/{made}"))
    page.get_by_role("button", name="Share").click()
    expect(page.get_by_text("tracemesh serve --lan")).to_be_visible()
