"""Looking at a surface: every look, uncertainty, the distance to a truth, and files for other programs."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect
from scipy.spatial.transform import Rotation

from tests.web.support import Rider, Server, share_of_pixels
from tracemesh.formats.meshes import read_mesh, write_triangles
from tracemesh.formats.rawnet import read_rawnet
from tracemesh.geometry.simulated.shapes import leaf

LOOKS = ("Shaded", "Isophotes", "Reflection lines", "Normal map", "Mean curvature", "Gaussian curvature")


@pytest.fixture
def view(server: Server, page: Page, rider: Callable[[str], Rider]) -> Locator:
    """The 3D view of a reconstructed leaf."""
    session = server.call("POST", "/sessions", {"name": "Leaf"})["id"]
    rider(session).ride(lambda m: False)
    server.call("POST", f"/sessions/{session}/reconstructions", {"step": "3%"})
    page.goto(server.page(f"#/sessions/{session}"))
    view = page.locator("canvas")
    expect(view).to_have_attribute("data-surface", "shown")
    return view


def test_every_look_draws_something_else_and_scales_have_legends(page: Page, view: Locator) -> None:
    pictures = []
    for look in LOOKS:
        page.get_by_label(look).check()
        page.wait_for_timeout(300)
        pictures.append(view.screenshot())
        expect(page.get_by_text(f"{look} (1/m")).to_have_count(1 if "curvature" in look else 0)
    assert len(set(pictures)) == len(LOOKS)
    expect(page.get_by_label("Distance to truth")).to_have_count(0)


def test_uncertainty_is_drawn_as_tubes_with_their_scale(page: Page, view: Locator) -> None:
    page.get_by_label("Surface", exact=True).uncheck()
    before = share_of_pixels(view, "view")[0]
    page.keyboard.press("w")
    expect(page.get_by_text("Tubes: ±")).to_contain_text("times as wide")
    page.wait_for_timeout(300)
    assert share_of_pixels(view, "view")[0] < before - 0.01


def test_a_dropped_truth_is_registered_and_colours_the_surface(page: Page, view: Locator, tmp_path: Path) -> None:
    vertices, faces = leaf().mesh()
    truth = tmp_path / "truth.obj"
    turned = Rotation.from_euler("z", 30, degrees=True).apply(vertices) + np.array([0.2, 0.1, 0.0])
    truth.write_bytes(write_triangles(turned, faces, "obj"))
    panel = page.get_by_role("complementary", name="Reconstruction and look")
    panel.get_by_label("Compare with a true mesh").set_input_files(truth)
    expect(page.get_by_text("Distance to truth (mm)")).to_be_visible()
    expect(page.get_by_label("Distance to truth")).to_be_checked()
    mean = panel.locator("dl div").filter(has=page.get_by_text("Mean", exact=True)).locator("dd")
    assert 0 < float(mean.inner_text().split("·")[1].rstrip(" %")) < 0.5
    panel.get_by_label("Laid on it").select_option("as it is")
    expect(mean).not_to_have_text("")
    expect(panel.get_by_text("Root mean square")).to_be_visible()

    wrong = tmp_path / "wrong.obj"
    wrong.write_text("v 1 2 three\n")
    panel.get_by_label("Another true mesh").set_input_files(wrong)
    expect(panel.get_by_role("alert")).to_contain_text("wrong.obj: ")
    expect(page.get_by_label("Shaded")).to_be_checked()


def test_every_file_that_leaves_is_what_it_says(page: Page, view: Locator, tmp_path: Path) -> None:
    def download(role: str, name: str) -> bytes:
        with page.expect_download() as download:
            page.get_by_role(role, name=name, exact=True).click()  # type: ignore[arg-type]
        file = tmp_path / download.value.suggested_filename
        download.value.save_as(file)
        return file.read_bytes()

    vertices, faces = read_mesh(download("link", "Surface (GLB)"), "glb")
    for extension in ("OBJ", "PLY", "STL"):
        also, triangles = read_mesh(download("button", extension), extension.lower())
        assert len(triangles) == len(faces)
        assert np.allclose(
            np.sort(also[triangles].sum(axis=1), axis=0), np.sort(vertices[faces].sum(axis=1), axis=0), atol=1e-5
        )
    assert len(read_rawnet(download("link", "Scan (rawnet)").decode()).curves) == 5
    assert json.loads(download("link", "Network (JSON)"))["format"] == "tracemesh-network"
    assert json.loads(download("link", "Recording (NDJSON)").splitlines()[0])["type"] == "hello"
    assert download("button", "Picture (PNG)").startswith(b"\x89PNG")
