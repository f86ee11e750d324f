"""Damage that SQLite's own check does not see is told in a line by every command, and what can be read is got out."""

from __future__ import annotations

import contextlib
import sqlite3

import pytest

from tests.support.commands import faults_of, run
from tests.support.example_book import write_example
from tests.support.stand_ins import stood_in

NULL_WORDS = """
PRAGMA writable_schema = ON;
UPDATE sqlite_master SET sql = replace(sql, 'words TEXT NOT NULL', 'words TEXT') WHERE name = 'feedback';
PRAGMA writable_schema = RESET;
UPDATE feedback SET words = NULL WHERE id = 1;
"""
DAMAGE = {
    "text that is not UTF-8": "UPDATE feedback SET words = CAST(x'616263d3' AS TEXT) WHERE id = 1",
    "a table under another name": "ALTER TABLE answers RENAME TO other",
    "nothing in a column that is never without": NULL_WORDS,
    "an entry without feedback": "DELETE FROM sources",
    "times that no calendar has": "UPDATE revisions SET time = 1e18; UPDATE feedback SET time = -1e300",
    "people whose names are no text": "UPDATE feedback SET who = x'07ff'",
    "a key without an action": "UPDATE keys SET action = ''",
}
COMMANDS = [
    ["check"],
    ["check", "--rescue", "rescued.db"],
    ["rebuild", "--out", "new.db"],
    ["stats", "--json"],
    ["list"],
    ["history"],
    ["show", "1"],
    ["reembed"],
    ["export"],
    ["forget", "ana0", "--yes"],
]


@pytest.fixture(scope="module", autouse=True)
def quickly():
    with stood_in():
        yield


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("damage", DAMAGE)
def test_no_damage_of_values_is_called_a_bug(damage, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_example(tmp_path / "book.db", notes=4)
    with contextlib.closing(sqlite3.connect(tmp_path / "book.db")) as book:
        book.executescript(DAMAGE[damage])
    code, out, err = run(["skillbook", *command, "--book", "book.db"])
    assert list(faults_of(code, out, err)) == [], (code, err[-500:])


def test_clustering_passes_over_templates_under_the_key_of_general_statements(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_example(tmp_path / "book.db", notes=4)
    with contextlib.closing(sqlite3.connect(tmp_path / "book.db")) as book:
        everywhere = "UPDATE entries SET key = (SELECT id FROM keys WHERE action = '') WHERE kind = 'template'"
        assert book.execute(everywhere).rowcount
        book.commit()
    code, out, err = run(["cluster", "--book", "book.db"])
    assert list(faults_of(code, out, err)) == [], (code, err[-500:])
