"""``memo skillbook edit|remove``: revisions, from the shell."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from memo_core.cli.skillbook import app
from memo_core.errors import InvalidArgument
from memo_core.skillbook.book import Skillbook


@pytest.fixture
def book(tmp_path: Path) -> str:
    path = str(tmp_path / "book.db")
    with Skillbook(path) as opened:
        opened.add_lessons(opened.record_feedback("an arc!", "ana"), "OPEN(door)", ["Pull it straight."])
        approval = opened.record_feedback("", "ana", kind="approval")
        opened.add_template(approval, "OPEN(door)", "def pull(name):\n    pass\n")
    return path


def memo(*arguments: str, stdin: str = "") -> dict[str, object]:
    found = CliRunner().invoke(app, [*arguments, "--json"], input=stdin, catch_exceptions=False)
    assert found.exit_code == 0, found.output
    return json.loads(found.stdout)


def texts(book: str) -> list[str]:
    return [entry["text"] for entry in memo("list", "--book", book)["entries"]]


def test_an_entry_is_edited_removed_and_both_are_rolled_back(book: str, tmp_path: Path) -> None:
    edited = memo("edit", "1", "Lead it along an arc.", "--who", "ben", "--book", book)
    assert texts(book) == ["def pull(name):\n    pass\n", "Lead it along an arc."]
    removed = memo("remove", str(edited["entry"]), "--who", "ben", "--book", book)
    assert texts(book) == ["def pull(name):\n    pass\n"]
    memo("rollback", str(removed["revision"]), "--book", book)
    memo("rollback", str(edited["revision"]), "--book", book)
    assert texts(book) == ["Pull it straight.", "def pull(name):\n    pass\n"]
    memo("edit", "1", "-", "--book", book, stdin="from stdin")
    new = tmp_path / "new.py"
    new.write_text("def pull(name, force=5):\n    pass\n")
    memo("edit", "2", "--file", str(new), "--book", book)
    assert texts(book) == ["from stdin", "def pull(name, force=5):\n    pass\n"]


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("1",), "the new text is needed once"),
        (("1", "text", "--file", "new.txt"), "the new text is needed once"),
        (("1", "--file", "missing.txt"), "missing.txt"),
        (("2", "pull it"), "no Python"),
        (("1", " "), "reworded to nothing"),
    ],
)
def test_what_is_no_new_text_is_refused(book: str, arguments: tuple[str, ...], problem: str) -> None:
    with pytest.raises(InvalidArgument, match=problem):
        CliRunner().invoke(app, ["edit", *arguments, "--book", book], catch_exceptions=False)


def test_a_search_for_a_subtask_tells_the_score_from_r(book: str) -> None:
    [found, _] = memo("search", "OPEN(door)", "--book", book, "--json")["results"]
    assert found["key_score"] == pytest.approx(1.0) and found["hint"] is False
    assert found["score"] != found["key_score"], "the text counts, too"
