"""The documentation's tables of measured figures, written from ``results/*.json``, of presets, from the
settings, and of the faults that ``memo doctor`` recognises; and ``offers.toml``, what the plugins offer.

A page marks each table with two comments, and what stands between them is written from the file or the settings::

    <!-- table: results/NAME.json -->
    <!-- /table -->

    <!-- table: preset paper -->
    <!-- /table -->

    <!-- table: faults -->
    <!-- /table -->

A file holds ``{"command": ..., "note": ..., "rows": [{heading: cell, ...}, ...]}``; every row has the same headings.

    python tools/tables.py            # write the tables of all pages
    python tools/tables.py --check    # fail if a page is not current
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
OFFERS = Path("memo_core", "plugins", "offers.toml")
_TABLE = re.compile(r"<!-- table: (\S+|preset \S+) -->\n(.*?)<!-- /table -->", re.DOTALL)


class TableError(Exception):
    """A result file or a page's reference to it is wrong; the message names the file."""


def markdown(path: Path) -> str:
    """The markdown table of a result file, with its command and note below.

    Raises:
        TableError: if the file cannot be read or its rows differ in their headings.
    """
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
        command, note, rows = result["command"], result["note"], result["rows"]
        headings = list(rows[0])
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        problem = f"{type(error).__name__}: {error}"
        raise TableError(f"{path}: {problem}; expected command, note and rows, a list of objects") from None
    for number, row in enumerate(rows, start=1):
        if list(row) != headings:
            raise TableError(f"{path}: row {number} has the headings {list(row)}, expected {headings}")
    table = _grid(headings, [list(row.values()) for row in rows])
    source = f"`{command}`" + (f": {note}" if note else "")
    return f"\n{table}\n{source}\n\n"


def preset_markdown(name: str) -> str:
    """The markdown tables of a preset: its settings beside the defaults, and what no setting chooses.

    Raises:
        TableError: if there is no such preset.
    """
    from memo_core.errors import UnknownName
    from memo_core.runs.preset_table import COLUMNS, DEPARTURES, preset_table

    try:
        rows = preset_table(name)
    except UnknownName as error:
        raise TableError(str(error)) from None
    settings = [[f"`{row.cells[0]}`", *row.cells[1:]] for row in rows]
    departures = _grid(["no setting", "the paper", "MEMO"], DEPARTURES)
    return f"\n{_grid(COLUMNS, settings)}\n{departures}\n`memo config preset {name}`\n\n"


def faults_markdown() -> str:
    """The markdown table of the faults that ``memo doctor`` recognises."""
    from memo_core.cli.faults import FAULTS

    rows = [[f"`{name}`", fault.sign, fault.cause, fault.remedy] for name, fault in FAULTS.items()]
    return f"\n{_grid(['fault', 'what you see', 'cause', 'remedy'], rows)}\n"


def _grid(headings: Sequence[object], lines: Sequence[Sequence[object]]) -> str:
    every = [headings, ["---"] * len(headings), *lines]
    return "".join(f"| {' | '.join(str(cell) for cell in line)} |\n" for line in every)


def with_tables(text: str, root: Path = ROOT) -> str:
    """A page's text with its generated tables written anew. Raises ``TableError``."""

    def written(found: re.Match[str]) -> str:
        kind, _, name = found[1].partition(" ")
        if kind == "preset":
            table = preset_markdown(name)
        else:
            table = faults_markdown() if kind == "faults" else markdown(root / found[1])
        return f"<!-- table: {found[1]} -->\n{table}<!-- /table -->"

    return _TABLE.sub(written, text)


def offers(root: Path = ROOT) -> str:
    """The text of ``offers.toml``: what each plugin offers, from its ``pyproject.toml``."""
    from memo_core.plugins.not_installed import offers_of

    lines = ["# Written by `python tools/tables.py` from the pyproject.toml of the plugins: what each offers.\n"]
    for file in [root / "benchmarks" / "pyproject.toml", *sorted(root.glob("plugins/*/pyproject.toml"))]:
        project = tomllib.loads(file.read_text(encoding="utf-8"))
        if found := offers_of(project):
            lines.append(f"{project['project']['name']} = {json.dumps(found)}\n")
    return "".join(lines)


def pages(root: Path = ROOT) -> list[Path]:
    """README and all pages of the documentation."""
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]


def outdated(root: Path = ROOT) -> dict[Path, str]:
    """Pages whose tables differ from the result files, and ``offers.toml``, with their current text. Raises
    ``TableError``."""
    found = {page: page.read_text(encoding="utf-8") for page in pages(root)}
    current = {page: with_tables(text, root) for page, text in found.items()}
    file = root / OFFERS
    if file.parent.is_dir():
        found[file] = file.read_text(encoding="utf-8") if file.exists() else ""
        current[file] = offers(root)
    return {page: text for page, text in current.items() if text != found[page]}


def main(arguments: list[str]) -> int:
    if arguments not in ([], ["--check"]):
        print(f"unknown arguments {' '.join(arguments)}; expected none or --check", file=sys.stderr)
        return 2
    try:
        changed = outdated()
    except TableError as error:
        print(error, file=sys.stderr)
        return 1
    for page, text in changed.items():
        if arguments:
            print(f"{page.relative_to(ROOT)}: not current; run python tools/tables.py", file=sys.stderr)
        else:
            page.write_text(text, encoding="utf-8")
            print(page.relative_to(ROOT))
    return 1 if arguments and changed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
