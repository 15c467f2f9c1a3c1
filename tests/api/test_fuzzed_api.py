"""No request that its own description allows, and none that it forbids, makes the server fail."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.mark.parametrize("database_kind", ["postgresql"], indirect=True)
def test_schemathesis_finds_no_server_error(start_server: Callable[..., Any], tmp_path: Path) -> None:
    """On PostgreSQL, the stricter one, and with the owner's token: whoever may less is refused sooner."""
    server = start_server(token="correct horse battery staple", max_requests=10**6)
    command = [Path(sys.executable).with_name("schemathesis"), "run", f"http://127.0.0.1:{server.port}/openapi.json"]
    command += ["--header", f"Authorization: Bearer {server.token}"]
    options = ["--phases", "coverage", "--checks", "not_a_server_error", "--seed", "1", "--no-color"]
    done = subprocess.run([*command, *options], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "passed" in done.stdout
