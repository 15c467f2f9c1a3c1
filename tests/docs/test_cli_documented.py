"""Every option of the command line is explained to a person."""

import argparse
from pathlib import Path

import pytest

from tracemesh.cli import build_parser

ROOT = Path(__file__).resolve().parents[2]


def subparsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """By what a person types: `reconstruct`, `token`, `token create` ..."""
    found = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, sub in action.choices.items():
                found[name] = sub
                found |= {f"{name} {rest}": below for rest, below in subparsers(sub).items()}
    return found


@pytest.mark.parametrize("command", sorted(subparsers(build_parser())))
def test_every_option_is_in_the_section_of_its_command(command: str) -> None:
    text = (ROOT / "docs" / "cli.md").read_text()
    (section,) = (s for s in text.split("\n## ") if s.startswith(f"tracemesh {command.split()[0]}"))
    parser = subparsers(build_parser())[command]
    options = {o for a in parser._actions for o in a.option_strings} - {"-h", "--help"}
    assert options <= {word.strip("`,") for word in section.split()}


@pytest.mark.parametrize("command", sorted(subparsers(build_parser())))
def test_every_argument_says_what_it_is_for(command: str) -> None:
    parser = subparsers(build_parser())[command]
    assert parser.description
    silent = [a.dest for a in parser._actions if not a.help and a.dest != "output"]
    assert silent == []
