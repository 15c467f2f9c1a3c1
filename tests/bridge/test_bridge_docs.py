"""Every option, key and fault of the bridge is documented."""

import argparse
from pathlib import Path

import pytest

from tracemesh_bridge.cli import parser
from tracemesh_bridge.framing import MEANINGS
from tracemesh_bridge.keys import KeyParser, Unknown
from tracemesh_bridge.source import LinkState

DOCS = Path(__file__).resolve().parents[2] / "docs"
BRIDGE = (DOCS / "bridge.md").read_text()


def commands():
    (actions,) = (a for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
    return actions.choices


def documented(heading):
    """The options in the table under a heading."""
    table = BRIDGE.split(f"## {heading}\n")[1].split("\n## ")[0]
    return {line.split("`")[1] for line in table.splitlines() if line.startswith("| `--")}


@pytest.mark.parametrize("command", commands())
def test_every_option_is_documented_and_nothing_else(command):
    options = {o for action in commands()[command]._actions for o in action.option_strings} - {"-h", "--help"}
    shared = documented("Options of every recording command") if "--spool" in options else set()
    assert options == documented(f"`{command}`") | shared


def test_every_key_is_documented():
    keys = BRIDGE.split("## Keys")[1].split("\n## ")[0]
    for key in map(chr, range(33, 127)):
        known = key.isdigit() or not any(isinstance(c, Unknown) for c in KeyParser().feed(key))
        assert known == (key.isdigit() or f"`{key}`" in keys), key


def test_every_state_is_documented():
    assert all(f"`{state}`" in BRIDGE or str(state) in BRIDGE for state in LinkState)


def test_every_part_of_a_frame_is_documented():
    page = (DOCS / "devices" / "morphorider.md").read_text()
    assert all(name.split("_")[0] in page for name in MEANINGS)


@pytest.mark.parametrize("page", sorted((DOCS / "devices").glob("*.md")), ids=lambda page: page.stem)
def test_every_device_and_the_table_of_tested_versions_lead_to_each_other(page):
    """And the table says that nothing of it was verified on hardware, as long as nothing was."""
    tested = BRIDGE.split("## Tested with\n")[1].split("\n## ")[0]
    assert f"](devices/{page.name}) |" in tested
    assert "(../bridge.md#tested-with)" in page.read_text()
    assert "unverified on real" in tested
