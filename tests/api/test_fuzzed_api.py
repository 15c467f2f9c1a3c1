"""No request that its own description allows, and none that it forbids, makes the server fail."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest


@pytest.mark.parametrize("server", ["postgresql"], indirect=True)  # the stricter one
def test_schemathesis_finds_no_server_error(server: Any, tmp_path: Path) -> None:
    command = [Path(sys.executable).with_name("schemathesis"), "run", f"http://127.0.0.1:{server.port}/openapi.json"]
    options = ["--phases", "coverage", "--checks", "not_a_server_error", "--seed", "1", "--no-color"]
    done = subprocess.run([*command, *options], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "passed" in done.stdout
