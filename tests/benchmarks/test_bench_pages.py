"""Every page of docs/algorithms begins with a picture that the code draws."""

from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


PAGES = sorted(set((DOCS / "algorithms").glob("*.md")) - {DOCS / "algorithms" / "README.md"})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_begins_with_its_picture(page: Path) -> None:
    lines = page.read_text().splitlines()
    assert lines[0].startswith("# ")
    assert lines[2].endswith(f"](../pictures/algorithms/{page.stem}.png)")
    assert (DOCS / "pictures" / "algorithms" / f"{page.stem}.png").is_file()
