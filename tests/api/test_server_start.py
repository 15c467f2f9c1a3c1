"""What keeps the server from starting is said in words, at once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("options", "environment", "says"),
    [
        (["--host", "0.0.0.0"], {}, "TRACEMESH_TOKEN"),
        (["--data-dir", "/proc/nowhere"], {}, "the data folder /proc/nowhere cannot be used"),
        (["--data-dir", "{tmp}/file"], {}, "cannot be used"),
        ([], {"TRACEMESH_DATABASE_URL": "postgresql://nobody@127.0.0.1:1/none"}, "the database cannot be used"),
        ([], {"TRACEMESH_DATABASE_URL": "mysql://nobody@127.0.0.1/none"}, "postgresql://"),
        ([], {"TRACEMESH_JOB_SLOTS": "many"}, "job_slots"),
    ],
)
def test_it_ends_with_a_line_that_says_why(
    tmp_path: Path, options: list[str], environment: dict[str, str], says: str
) -> None:
    (tmp_path / "file").touch()
    command = [sys.executable, "-m", "tracemesh", "serve", "--port", "0"]
    given = {"TRACEMESH_DATA_DIR": str(tmp_path), **environment}
    done = subprocess.run(
        [*command, *(option.format(tmp=tmp_path) for option in options)],
        env={**os.environ, **given},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode in (1, 2)
    assert says in done.stderr
    assert "Traceback" not in done.stderr
