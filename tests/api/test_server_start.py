"""What keeps the server from starting is said in words, at once."""

import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest


@pytest.mark.parametrize(
    ("options", "environment", "says"),
    [
        ([], {"TRACEMESH_TOKEN": "secret"}, "characters"),
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


def test_an_address_that_is_taken_is_named_before_anything_starts(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        command = [
            sys.executable,
            "-m",
            "tracemesh",
            "serve",
            "--port",
            str(port),
            "--data-dir",
            str(tmp_path / "data"),
        ]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"tracemesh: cannot listen at 127.0.0.1:{port}: Address already in use")
    assert (done.returncode, (tmp_path / "data").exists()) == (1, False)


def test_the_first_start_off_loopback_prints_the_owners_link_and_never_again(
    plain_server_process: Any, tmp_path: Path
) -> None:
    def started(output: Path) -> tuple[Any, str]:
        with output.open("w") as file:
            server = plain_server_process.start(host="0.0.0.0", stdout=file)
        while "Open" not in output.read_text():
            assert plain_server_process.process.poll() is None
            time.sleep(0.05)
        return server, output.read_text()

    _, first = started(tmp_path / "first")
    plain_server_process.kill()
    server, second = started(tmp_path / "second")
    (secret,) = re.findall(r"http://\S+/\?token=(\S+)", first)
    assert "token=" not in second
    assert "tracemesh token create" in second
    assert server.http.get("/sessions").status_code == 401
    assert server.http.get("/sessions", headers={"Authorization": f"Bearer {secret}"}).status_code == 200


def test_a_server_loads_nothing_large_before_somebody_needs_it() -> None:
    """What its workers do is not in the server's memory, and not in the time that it takes to start."""
    large = {"scipy", "trimesh", "tracemesh.pipeline", "distributed", "qdldl", "cryptography", "alembic"}
    code = "import sys, tracemesh.api.server; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "tracemesh.api.server" in loaded
    assert large.intersection(loaded) == set()
