"""From an empty list of sessions to a surface, in a real browser through the real server."""

import re
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Locator, Page, expect

from tests.web.support import Rider, Server, share_of_pixels
from tracemesh.formats.meshes import read_mesh
from tracemesh.formats.rawnet import write_rawnet
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan


def test_a_ride_is_watched_and_becomes_a_surface(
    server: Server, page: Page, rider: Callable[[str], Rider], tmp_path: Path
) -> None:
    page.goto(server.page())
    expect(page.get_by_text("A session is one object that you scan")).to_be_visible()
    page.get_by_label("Name of the new session").fill("Leaf")
    page.get_by_role("button", name="New session").click()
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    session = page.url.rsplit("/", 1)[1]
    view = page.locator("canvas")
    curves = page.get_by_role("complementary", name="Curves and nodes")

    device = rider(session)
    device.ride(lambda m: m["type"] == "samples" and m["first_sample"] >= 300)
    expect(page.get_by_text("Nothing scanned yet.")).to_be_hidden()
    expect(page.get_by_role("status").filter(has_text="simulated").or_(page.get_by_text("dip 60"))).to_be_visible()
    early = _length(curves)
    boundary_then, interior_then = share_of_pixels(view, "curve-boundary", "curve-interior")
    assert boundary_then > 0.0005
    assert interior_then == 0

    device.ride(lambda m: m["type"] == "curve.end")
    expect(curves.get_by_role("button", name="boundary")).to_contain_text("closed")
    assert _length(curves) > early
    assert share_of_pixels(view, "curve-boundary")[0] > boundary_then
    expect(curves.get_by_role("list", name="Marked nodes").get_by_role("listitem")).not_to_have_count(0)

    device.ride(lambda m: False)
    expect(curves.get_by_role("button", name="interior")).to_have_count(4)
    page.get_by_role("button", name="Reconstruct").click()
    expect(view).to_have_attribute("data-surface", "shown")
    triangles = int(view.get_attribute("data-triangles") or 0)
    assert _bare(page, view) > 0.1

    with page.expect_download() as download:
        page.get_by_role("link", name="Surface (GLB)").click()
    download.value.save_as(tmp_path / "mesh.glb")
    _, faces = read_mesh((tmp_path / "mesh.glb").read_bytes(), "glb")
    assert len(faces) == triangles


def test_a_late_joiner_sees_everything_and_looks_closer(
    server: Server, page: Page, rider: Callable[[str], Rider]
) -> None:
    session = server.call("POST", "/sessions", {"name": "Leaf, again"})["id"]
    rider(session).ride(lambda m: False)
    job = server.call("POST", f"/sessions/{session}/reconstructions", {})
    page.goto(server.page(f"#/sessions/{session}"))
    view = page.locator("canvas")
    expect(view).to_have_attribute("data-surface", "shown")
    assert server.call("GET", f"/reconstructions/{job['id']}")["state"] == "done"

    page.keyboard.press("?")
    expect(page.get_by_role("dialog", name="Keys")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog", name="Keys")).to_have_count(0)
    page.keyboard.press("b")
    expect(page.get_by_role("img", name="Gauss map").locator("path")).not_to_have_count(0)

    page.keyboard.press("m")
    box = view.bounding_box()
    assert box is not None
    centre = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.click(centre[0] - 60, centre[1])
    page.mouse.click(centre[0] + 60, centre[1])
    expect(page.locator("svg text").filter(has_text=re.compile(r"^[\d.]+ (mm|cm|m)$"))).to_be_visible()
    with page.expect_download() as download:
        page.keyboard.press("x")
    assert download.value.suggested_filename == "Leaf, again.png"


def test_everybody_sees_how_many_watch(server: Server, page: Page) -> None:
    address = server.page(f"#/sessions/{server.call('POST', '/sessions', {})['id']}")
    page.goto(address)
    expect(page.get_by_text("Nothing scanned yet.")).to_be_visible()
    expect(page.get_by_text("watching")).to_have_count(0)
    other = page.context.new_page()
    other.goto(address)
    for each in (page, other):
        expect(each.get_by_text("2 watching")).to_be_visible()
    other.close()
    expect(page.get_by_text("watching")).to_have_count(0)


def test_sessions_are_renamed_and_deleted_with_undo(server: Server, page: Page) -> None:
    for name in ("Vase", "Bowl"):
        server.call("POST", "/sessions", {"name": name})
    page.goto(server.page())
    page.get_by_role("button", name="Rename Vase").click()
    page.get_by_label("Name of the session").fill("Jug")
    page.keyboard.press("Enter")
    expect(page.get_by_role("link", name="Jug")).to_be_visible()
    page.get_by_label("Search sessions").fill("bow")
    expect(page.get_by_role("link", name="Jug")).to_be_hidden()
    page.get_by_label("Search sessions").fill("")

    page.get_by_role("button", name="Delete Bowl").click()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_role("link", name="Bowl")).to_be_visible()
    page.get_by_role("button", name="Delete Bowl").click()
    page.get_by_role("link", name="Jug").click()
    page.get_by_role("link", name="tracemesh").click()
    expect(page.get_by_role("link", name="Jug")).to_be_visible()
    names = {session["name"] for session in server.call("GET", "/sessions")}
    assert "Jug" in names
    assert "Bowl" not in names


def test_a_file_is_opened_edited_and_reconstructed_with_other_parameters(
    server: Server, page: Page, tmp_path: Path
) -> None:
    scan = tmp_path / "leaf.rawnet"
    scan.write_text(write_rawnet(exact_scan(leaf(), 0.01)))
    page.goto(server.page())
    page.locator("input[type=file]").set_input_files(scan)
    curves = page.get_by_role("complementary", name="Curves and nodes")
    expect(curves.get_by_role("button", name="interior")).to_have_count(4)
    expect(page.get_by_label("Name of the session")).to_have_value("leaf")
    session = page.url.rsplit("/", 1)[1]

    curves.get_by_role("button", name="3 interior").click()
    curves.get_by_role("button", name="Remove").click()
    expect(curves.get_by_role("button", name="interior")).to_have_count(3)
    curves.get_by_role("button", name="Undo").click()
    expect(curves.get_by_role("button", name="interior")).to_have_count(4)

    nodes = curves.get_by_role("list", name="Marked nodes").get_by_role("listitem")
    expect(nodes).to_have_count(11)
    curves.get_by_role("button", name="Edit node 8").click()
    curves.get_by_label("is").fill("9")
    curves.get_by_role("button", name="Set").click()
    expect(nodes).to_have_count(10)
    curves.get_by_role("button", name="Undo").click()
    expect(nodes).to_have_count(11)

    page.get_by_text("Parameters").click()
    page.get_by_role("slider", name="Step").fill("0.4")
    expect(page.get_by_title("Smooths over this length by resisting change of curvature")).to_contain_text(
        re.compile(r"\d (mm|cm|m)")
    )
    prefilter = page.get_by_title("Averages measured frames over this width")
    expect(prefilter).to_contain_text(re.compile(r"\d (mm|cm|m)"))
    prefilter.get_by_role("checkbox").uncheck()
    with page.expect_response(lambda r: r.url.count("/preview") and "0.0158" in (r.request.post_data or "")) as answer:
        prefilter.get_by_role("slider").fill("0.4")
    assert answer.value.json()["report"]["parameters"]["prefilter_m"] == 0.0158
    page.get_by_role("button", name="Back to automatic").click()

    page.get_by_role("button", name="Reconstruct").click()
    view = page.locator("canvas")
    expect(view).to_have_attribute("data-surface", "shown")
    coarse = int(view.get_attribute("data-triangles") or 0)
    page.get_by_role("slider", name="Step").fill("0.3")
    expect(page.get_by_text("Parameters (changed)")).to_be_visible()
    expect(view).not_to_have_attribute("data-triangles", str(coarse))
    expect(view).to_have_attribute("data-surface", "shown")
    assert int(view.get_attribute("data-triangles") or 0) > coarse
    jobs = server.call("GET", f"/sessions/{session}/reconstructions")
    assert [job["parameters"]["step"] for job in jobs] == ["0.901%", "1.6%"]


def test_nodes_that_were_not_marked_are_found_and_accepted(server: Server, page: Page, shared_data: Path) -> None:
    page.goto(server.page())
    page.locator("input[type=file]").set_input_files(shared_data / "scans" / "cone-noisy.rawnet")
    curves = page.get_by_role("complementary", name="Curves and nodes")
    expect(curves.get_by_role("button", name="interior")).to_have_count(4)
    session = page.url.rsplit("/", 1)[1]
    for index in (2, 3):
        server.call("PATCH", f"/sessions/{session}/curves/{index}", {"marks": []})

    curves.get_by_role("button", name="Find unmarked nodes").click()
    proposals = curves.get_by_role("list", name="Proposed nodes").get_by_role("listitem")
    expect(proposals).to_have_count(4)
    for left in (3, 2, 1):
        proposals.first.get_by_role("button", name="Accept").click()
        expect(proposals).to_have_count(left)
    proposals.first.get_by_role("button", name="Accept").click()
    expect(curves.get_by_text("No more nodes were found.")).to_be_visible()
    marks = [curve["marks"] for curve in server.call("GET", f"/sessions/{session}/curves")]
    assert len(marks[2]) == len(marks[3]) == 2
    page.get_by_role("button", name="Reconstruct").click()
    expect(page.locator("canvas")).to_have_attribute("data-surface", "shown")


def test_a_file_that_is_none_is_refused_in_words(server: Server, page: Page, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.rawnet"
    wrong.write_text("1\n0\nabc\n")
    page.goto(server.page())
    before = server.call("GET", "/sessions")
    page.locator("input[type=file]").set_input_files(wrong)
    expect(page.get_by_role("alert")).to_contain_text("wrong.rawnet was not opened: ")
    expect(page.get_by_role("alert")).to_contain_text("line")
    assert server.call("GET", "/sessions") == before


def test_an_address_of_nothing_says_so(server: Server, page: Page) -> None:
    page.goto(server.page("#/sessions/nowhere"))
    expect(page.get_by_role("alert")).to_contain_text("nowhere")


def _length(curves: Locator) -> float:
    """Length of the only curve as listed, m."""
    factors = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
    found = re.search(r"([\d.]+) (mm|cm|m)\b", curves.get_by_role("button").first.inner_text())
    assert found is not None
    return float(found[1]) * factors[found[2]]


def _bare(page: Page, view: Locator) -> float:
    """Part of the picture that is neither background, nor curve, nor grid: the surface, seen without the grid."""
    page.get_by_label("Grid").uncheck()
    page.get_by_label("Curves", exact=True).uncheck()
    return 1 - share_of_pixels(view, "view")[0]
