"""docs/benchmarks.json and docs/benchmarks.md: the tables of the last run, with the machine at the head.

Other pages quote tables between `<!-- measured: NAME -->` and `<!-- end -->`.
"""

import json
import re
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from benchmarks.table import Table


class Record(TypedDict):
    """One table as it was measured: when, of which commit, in how many seconds; s of the yardstick just before."""

    table: dict[str, Any]
    measured: str
    revision: str
    seconds: float
    yardstick: NotRequired[float]


class Report(TypedDict):
    machine: dict[str, object]
    tables: dict[str, Record]


QUOTE = re.compile(r"(?<=<!-- measured: )(\w+)( -->\n).*?(?=<!-- end -->)", re.DOTALL)
HEAD = """# Benchmarks

Written by `make bench` (`python -m benchmarks`; with the names of tables it measures these alone and keeps the others);
the same figures unrounded are in [benchmarks.json](benchmarks.json). No figure is typed in except published ones, which
are named as such. The kernel's times are processor times with one thread: what a clock shows on a machine that does
nothing else. Machines that call themselves the same were seen to differ by a factor of two: the yardstick below a table
is the processor time of one piece of work that never changes, just before the table was measured.
"""


def record(table: Table, measured: str, revision: str, seconds: float, yardstick: float) -> Record:
    return Record(table=table.document(), measured=measured, revision=revision, seconds=seconds, yardstick=yardstick)


def read_report(path: Path, machine: dict[str, object]) -> Report:
    """The saved report, or an empty one where there is none or it is another machine's: never mixed in one table."""
    if path.exists():
        saved: Report = json.loads(path.read_text())
        if saved["machine"] == machine:
            return saved
    return Report(machine=machine, tables={})


def elsewhere(path: Path, machine: dict[str, object]) -> str:
    """What differs on the machine of the saved report, in words; nothing where it is this one, or there is none."""
    if not path.exists():
        return ""
    saved: Report = json.loads(path.read_text())
    there, here = (_flat(known) for known in (saved["machine"], machine))
    names = sorted(name for name in there | here if there.get(name) != here.get(name))
    return ", ".join(f"{name} {there.get(name)} there, {here.get(name)} here" for name in names)


def _flat(machine: dict[str, object]) -> dict[str, object]:
    packages = machine.get("packages")
    return {**machine, "packages": None, **(packages if isinstance(packages, dict) else {})}


def write_report(folder: Path, report: Report, order: list[str]) -> None:
    """Write both files, tables in the given order, and the pages that quote them."""
    tables = {name: report["tables"][name] for name in order if name in report["tables"]}
    report = Report(machine=report["machine"], tables=tables)
    (folder / "benchmarks.json").write_text(json.dumps(report, indent=1) + "\n")
    (folder / "benchmarks.md").write_text(
        "\n".join([HEAD, _machine(report["machine"]), *map(_section, tables.values())])
    )
    for page in folder.glob("*.md"):
        text = page.read_text()
        if (quoted := with_quotes(text, tables)) != text:
            page.write_text(quoted)


def with_quotes(page: str, tables: dict[str, Record]) -> str:
    """The text of a page with every table that it quotes as it was measured last."""
    return QUOTE.sub(lambda found: f"{found[1]}{found[2]}{_quoted(found, tables)}", page)


def _quoted(found: re.Match[str], tables: dict[str, Record]) -> str:
    name, text = found[1], found[0]
    if name not in tables:
        return text.removeprefix(f"{name}{found[2]}")
    _, body = Table.read(tables[name]["table"]).markdown().split("\n", 1)
    return f"\n{body.strip()}\n\n"


def _machine(machine: dict[str, object]) -> str:
    packages = machine["packages"]
    assert isinstance(packages, dict)
    lines = [f"* {name.replace('_', ' ')}: {value}" for name, value in machine.items() if name != "packages"]
    return "\n".join([*lines, "* packages: " + ", ".join(f"{name} {v}" for name, v in packages.items())]) + "\n"


def _section(entry: Record) -> str:
    foot = f"Measured {entry['measured']}, commit {entry['revision']}, in {entry['seconds']:.0f} s"
    foot += f"; yardstick {1000 * entry['yardstick']:.0f} ms." if "yardstick" in entry else "."
    return f"{Table.read(entry['table']).markdown()}\n{foot}\n"
