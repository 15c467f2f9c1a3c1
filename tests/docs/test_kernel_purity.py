"""The kernel loads nothing but numerical libraries."""

import subprocess
import sys

PROBE = """
import pkgutil, importlib, sys
import tracemesh.geometry as kernel
for module in pkgutil.walk_packages(kernel.__path__, "tracemesh.geometry."):
    importlib.import_module(module.name)
print(" ".join(sorted({name.split(".")[0] for name in sys.modules} & set(sys.argv[1:]))))
"""
FOREIGN = ("pydantic", "fastapi", "starlette", "sqlalchemy", "trimesh", "uvicorn", "websockets", "serial", "httpx")


def test_importing_the_kernel_loads_nothing_of_the_web() -> None:
    found = subprocess.run([sys.executable, "-c", PROBE, *FOREIGN], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []
