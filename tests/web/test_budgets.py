"""What a browser must fetch before a page works stays small."""

import gzip
import re
from pathlib import Path

import pytest

BUILT = Path(__file__).resolve().parents[2] / "server/tracemesh/web"


@pytest.mark.parametrize(("page", "budget"), [("scan.html", 150_000), ("index.html", 150_000)])
def test_first_load(page: str, budget: int) -> None:
    assert sum(map(_compressed, _closure(BUILT / page))) <= budget


def test_the_3d_view_comes_later_and_stays_within_its_budget() -> None:
    (view,) = (path for path in (BUILT / "assets").glob("View-*.js"))
    assert view not in _closure(BUILT / "index.html")
    assert _compressed(view) <= 200_000


def _closure(page: Path) -> set[Path]:
    """The page and every script and style that it needs at once; scripts that are imported on demand are not."""
    found, waiting = {page}, {page}
    while waiting:
        text = waiting.pop().read_text()
        names = re.findall(r'(?:src|href)="\.?/?(assets/[^"]+)"', text)
        names += [f"assets/{name}" for name in re.findall(r'(?:from|import)\s*"\./([^"]+)"', text)]
        fresh = {BUILT / name for name in names} - found
        found |= fresh
        waiting |= fresh
    assert len(found) > 1
    return found


def _compressed(path: Path) -> int:
    return len(gzip.compress(path.read_bytes()))
