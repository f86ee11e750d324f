"""What `make setup` installs is pinned, and its licences are listed."""

from __future__ import annotations

import re
import sysconfig
from importlib.metadata import distributions
from pathlib import Path

ROOT = Path(__file__).parents[1]


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned() -> set[str]:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return {normal(line.partition("==")[0]) for line in lines if "==" in line}


def test_every_installed_distribution_is_pinned():
    site = [sysconfig.get_path("purelib"), sysconfig.get_path("platlib")]  # Ray brings a psutil on a path of its own
    installed = {normal(one.metadata["Name"]) for one in distributions(path=site)}
    installed = {name for name in installed if name != "pip" and not name.startswith("memo-")}
    assert installed - pinned() == set()


def test_the_licence_of_every_pinned_distribution_is_listed():
    page = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    licence_of = {normal(name): worded for worded, names in rows for name in names.split(", ")}
    assert pinned() <= set(licence_of)
    assert re.search("LGPL|Lesser", licence_of["psycopg"])
