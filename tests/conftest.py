"""What tests of every area share."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of scans and networks with known truth, kept beside the checkout."""
    folder = ROOT.parent / "shared" / "data"
    assert folder.is_dir(), f"wanted the data with known truth in {folder}"
    return folder
