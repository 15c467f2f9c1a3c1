"""The README's example is run word for word."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_readme_example_reconstructs_a_simulated_leaf(tmp_path: Path) -> None:
    (block,) = re.findall(r"```\n(\.venv/bin/tracemesh simulate.*?)```", (ROOT / "README.md").read_text(), re.S)
    for line in block.strip().splitlines():
        words = shlex.split(line.replace(".venv/bin/tracemesh", f"{sys.executable} -m tracemesh"))
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "leaf.glb").read_bytes()[:4] == b"glTF"
    assert json.loads((tmp_path / "leaf.report.json").read_text())["surface"]["euler_number"] == 1
