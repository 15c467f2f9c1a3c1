"""The examples of docs/api.md run, and no route is left out."""

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tracemesh.api.app import create_app
from tracemesh.settings import Settings

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "api.md").read_text()


def examples(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def base(server: Any, shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A server's address; the working folder holds a scan."""
    (tmp_path / "scan.rawnet").write_bytes((shared_data / "lilium.rawnet").read_bytes())
    monkeypatch.chdir(tmp_path)
    return f"http://127.0.0.1:{server.port}"


def test_the_python_example_makes_a_mesh(base: str) -> None:
    names: dict[str, Any] = {"server": base}
    for example in examples("python"):
        exec(example, names)
    assert names["mesh"][:4] == b"glTF"
    assert len(names["results"].namelist()) == 6


def test_the_curl_example_queues_a_job(base: str, server: Any) -> None:
    script = f"set -e\nserver={base}\n{''.join(examples('sh'))}"
    subprocess.run(["sh", "-c", script], check=True, stdout=subprocess.DEVNULL)
    assert len(server.http.get("/sessions/lamp/reconstructions").json()) == 1


def test_every_route_is_on_the_page() -> None:
    missing = []
    for path in create_app(Settings()).openapi()["paths"]:
        short = path.removeprefix("/api/v1").replace("{name}", "mesh.glb")
        if short not in PAGE and f".../{'/'.join(short.split('/')[-2:])}" not in PAGE:
            missing.append(path)
    assert missing == []
