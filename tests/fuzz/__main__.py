"""Coverage-guided fuzzing: python -m tests.fuzz TARGET [options of libFuzzer], such as -max_total_time=60.

Finds grow a corpus of their own in .fuzz/TARGET, beside the small one of the repository. An input that breaks a law is
written as crash-*; put it into tests/fuzz/corpus/TARGET, where `make test` tries it for ever after.
"""

import json
import random
import sys
from pathlib import Path
from typing import Any

import atheris

with atheris.instrument_imports(include=["tracemesh", "tracemesh_bridge"]):
    from tests.fuzz.targets import TARGETS

CORPUS = Path(__file__).parent / "corpus"
BYTES = ("rawnet", "frame", "mesh", "mrider")
"""Targets whose input is no JSON."""


VALUES = (0, -1, 1, 1e308, 1e-300, 2**31, True, None, "", "node", [], {}, [0, 0, 0], [1.0, 0.0, 0.0, 0.0])


def mutate_json(data: bytes, most: int, seed: int) -> bytes:
    """Another value somewhere in one of the lines of JSON; any bytes at all now and then, or where there is none."""
    choose = random.Random(seed)
    lines = data.decode("utf-8", "replace").split("\n")
    row = choose.randrange(len(lines))
    try:
        document = json.loads(lines[row])
    except (ValueError, RecursionError):
        document = None
    if document is None or choose.random() < 0.2:
        return bytes(atheris.Mutate(data, most))
    lines[row] = json.dumps(_changed(document, choose))
    return "\n".join(lines).encode()[:most]


def _changed(value: Any, choose: random.Random) -> Any:
    keys = list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    if not keys or choose.random() < 0.1:
        return choose.choice(VALUES)
    key = choose.choice(keys)
    if choose.random() < 0.15:
        del value[key]
    elif isinstance(value, list) and choose.random() < 0.15:
        value.append(value[key])
    else:
        value[key] = _changed(value[key], choose)
    return value


def main() -> None:
    """Fuzz until something is found or the options say enough."""
    if len(sys.argv) < 2 or sys.argv[1] not in TARGETS:
        sys.exit(f"usage: python -m tests.fuzz {{{','.join(TARGETS)}}} [options of libFuzzer]")
    name = sys.argv[1]
    grown = Path(".fuzz") / name
    grown.mkdir(parents=True, exist_ok=True)
    options = {} if name in BYTES else {"custom_mutator": mutate_json}
    atheris.Setup([sys.argv[0], *sys.argv[2:], str(grown), str(CORPUS / name)], TARGETS[name], **options)
    atheris.Fuzz()


main()
