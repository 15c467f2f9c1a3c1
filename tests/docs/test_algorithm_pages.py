"""Every file of the kernel is explained on a page that has an equation, a picture made by the code, and a cost."""

import re
from pathlib import Path

import pytest

from benchmarks.pictures.__main__ import PICTURES

ROOT = Path(__file__).resolve().parents[2]
KERNEL = ROOT / "server" / "tracemesh" / "geometry"
INDEX = ROOT / "docs" / "algorithms" / "README.md"
PAGES = sorted(set(INDEX.parent.glob("*.md")) - {INDEX})
EQUATION = re.compile(r"^ {4,}\S.*[=≈>−+Σ∫]", re.MULTILINE)
PICTURE = re.compile(r"\(\.\./pictures/algorithms/(\w+)\.png\)")


def test_every_file_is_named_on_a_page() -> None:
    text = "\n".join(page.read_text() for page in (INDEX, *PAGES))
    files = [f for f in KERNEL.rglob("*.py") if f.name != "__init__.py"]
    assert [f.name for f in files if not re.search(rf"[`/]{f.name}`", text)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_a_page_has_an_equation_a_picture_and_a_cost(page: Path) -> None:
    text = page.read_text()
    assert EQUATION.search(text)
    assert set(PICTURE.findall(text)) <= set(PICTURES)
    assert page.stem in PICTURE.findall(text)
    assert re.search(r"^Cost\b.*\d", text, re.MULTILINE)
    assert f"({page.name})" in INDEX.read_text()


def test_every_picture_of_the_code_is_on_a_page() -> None:
    shown = {name for page in PAGES for name in PICTURE.findall(page.read_text())}
    assert set(PICTURES) - shown == set()
