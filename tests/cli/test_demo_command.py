"""The demo without a browser: the same port, bridge, server and job, measured against the shape it scanned."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import trimesh


def test_the_headless_demo_leaves_an_accurate_surface(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tracemesh", "demo", "--headless", "--out", str(tmp_path), "--port", "0"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mesh.glb", "network.json", "report.json"]
    report = json.loads((tmp_path / "report.json").read_text())
    assert 0 < report["error"]["mean"] <= 1.0
    mesh = trimesh.load(tmp_path / "mesh.glb", force="mesh", process=True)
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 1
    network = json.loads((tmp_path / "network.json").read_text())
    assert np.linalg.norm(np.ptp(network["points"], axis=0)) > 0.5
