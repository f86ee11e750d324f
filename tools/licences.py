"""Write docs/licences.md: the licence of every pinned distribution, as its own metadata states it."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
HEAD = """# Licences of the dependencies

MEMO itself is under Apache-2.0. It imports the distributions below (`constraints.txt`) and ships none of them.
`python tools/licences.py` writes the table from their own metadata.

**Copyleft:** `psycopg` and `psycopg-binary` (LGPL version 3) are only installed with the extra `postgres`. Whoever
redistributes an environment with them must allow them to be replaced. The table shows further licences with conditions
(MPL, LGPL, GPL).

| licence | distributions |
|---|---|
"""


def pinned() -> list[str]:
    """Names in constraints.txt."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return [line.partition("==")[0] for line in lines if "==" in line]


def licence(name: str) -> str:
    """The licence in one line; "not stated" where the metadata has none."""
    try:
        about = metadata(name)
    except PackageNotFoundError:
        return "not installed here"
    classifiers = [c.rpartition(" :: ")[2] for c in about.get_all("Classifier", []) if c.startswith("License ::")]
    said = about.get("License-Expression") or ", ".join(dict.fromkeys(classifiers)) or about.get("License") or ""
    first = next((line.strip() for line in said.splitlines() if line.strip()), "not stated")
    return re.sub(r"[|<>]", " ", first)[:100]


def page() -> str:
    """The page: a row for each licence as it is worded, the most frequent first."""
    named: dict[str, list[str]] = {}
    for name in pinned():
        named.setdefault(licence(name), []).append(name)
    rows = sorted(named.items(), key=lambda row: (-len(row[1]), row[0]))
    return HEAD + "".join(f"| {worded} | {', '.join(names)} |\n" for worded, names in rows)


if __name__ == "__main__":
    (ROOT / "docs" / "licences.md").write_text(page(), encoding="utf-8")
