"""What pages say was measured is what was measured last."""

import json
import math
import re
from pathlib import Path

import pytest

from benchmarks.report import QUOTE, with_quotes

DOCS = Path(__file__).resolve().parents[2] / "docs"
TABLES = json.loads((DOCS / "benchmarks.json").read_text())["tables"]
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


@pytest.mark.parametrize("page", [p for p in DOCS.glob("*.md") if QUOTE.search(p.read_text())], ids=lambda p: p.stem)
def test_quoted_tables_are_those_of_the_last_run(page: Path) -> None:
    text = page.read_text()
    assert {name for name, _ in QUOTE.findall(text)} <= TABLES.keys()
    assert with_quotes(text, TABLES) == text


def test_enough_servers_for_a_thousand_devices() -> None:
    (limit,) = re.findall(r"Limit found: (\d+) devices", " ".join(TABLES["ingest"]["table"]["notes"]))
    said = (DOCS / "scale.md").read_text()
    assert f"One process holds {limit} devices at full rate" in said
    assert f"at a yardstick of {1000 * TABLES['ingest']['yardstick']:.0f} ms" in " ".join(said.split())
    (servers,) = re.findall(r"\*\*(\w+) server processes\*\*", said)
    assert NUMBERS.index(servers.lower()) >= math.ceil(1000 / int(limit))
