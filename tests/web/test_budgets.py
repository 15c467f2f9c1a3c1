"""What a browser must fetch before a page works stays small."""

import pytest

from benchmarks.browsing import BUILT, closure, compressed


@pytest.mark.parametrize(("page", "budget"), [("scan.html", 150_000), ("index.html", 150_000)])
def test_first_load(page: str, budget: int) -> None:
    needed = closure({BUILT / page})
    assert len(needed) > 1
    assert sum(map(compressed, needed)) <= budget


def test_the_3d_view_comes_later_and_stays_within_its_budget() -> None:
    (view,) = (path for path in (BUILT / "assets").glob("View-*.js"))
    assert view not in closure({BUILT / "index.html"})
    assert sum(map(compressed, closure({BUILT / "scan.html", view}))) <= 350_000
