"""The pictures of the algorithms are drawn by code and belong to pages that exist."""

from pathlib import Path

import pytest

from benchmarks.pictures.__main__ import PICTURES
from benchmarks.pictures.canvas import save


@pytest.mark.filterwarnings("ignore:.*deprecated:DeprecationWarning")
def test_a_plot_and_a_surface_are_drawn(tmp_path: Path) -> None:
    for name in ("cleaning", "cycles"):
        save(PICTURES[name](), tmp_path / f"{name}.png")
        first = (tmp_path / f"{name}.png").read_bytes()
        assert first.startswith(b"\x89PNG")
        assert len(first) > 20_000
