"""The browser's types are those of the server's models."""

import os
import subprocess
import sys
from pathlib import Path

WEB = Path(__file__).resolve().parents[2] / "web"


def test_generated_types_are_fresh() -> None:
    command = ["node", "scripts/wire.mjs", "--check"]
    outcome = subprocess.run(
        command, cwd=WEB, env={**os.environ, "PYTHON": sys.executable}, capture_output=True, text=True, check=False
    )
    assert outcome.returncode == 0, outcome.stderr


def test_lock_file_names_no_registry() -> None:
    assert "://" not in "".join(
        line for line in (WEB / "package-lock.json").read_text().splitlines() if '"resolved"' in line
    )
