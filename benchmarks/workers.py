"""How soon worker processes of a server are there, and what they take: `python -m benchmarks.workers` measures once."""

import json
import subprocess
import sys
import time
from pathlib import Path

from tracemesh.jobs.slot import Slot
from tracemesh.jobs.work import load_kernel


def worker_starts() -> tuple[float, float, float]:
    """s until the first one works, s until the second does, and what the second needs for itself, MB (Linux)."""
    out = subprocess.run([sys.executable, "-m", __name__], capture_output=True, check=True, text=True).stdout
    first, second, own = json.loads(out)
    return first, second, own


def own_memory() -> float:
    """Memory that this process shares with no other one, MB (Linux)."""
    lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Private")) / 1000


def _measure() -> tuple[float, float, float]:
    slots = Slot(), Slot()
    try:
        return _begun(slots[0]), _begun(slots[1]), slots[1].submit(own_memory).result()
    finally:
        for slot in slots:
            slot.close()


def _begun(slot: Slot) -> float:
    begin = time.perf_counter()
    slot.submit(load_kernel).result()
    return time.perf_counter() - begin


if __name__ == "__main__":
    print(json.dumps(_measure()))
