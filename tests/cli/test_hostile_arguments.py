"""Names, numbers and paths that no command can use are refused in one line: no bug and no traceback."""

from __future__ import annotations

import pytest

from tests.support.commands import faults_of, run
from tests.support.example_book import write_example
from tests.support.stand_ins import stood_in

BOOK = ["--book", "book.db"]
NOT_UTF8 = "\udcff"  # how Python spells a byte of an argument that is not UTF-8
HUGE = "9" * 30  # beyond what a database counts to

COMMANDS = [
    ["config", "check", "loop"],
    ["evaluate", "loop", "--replay", "loop"],
    ["report", "loop"],
    ["budget", "loop"],
    ["skillbook", "list", "--book", "loop"],
    ["skillbook", "list", "--book", ""],
    ["skillbook", "list", "--book", f"{NOT_UTF8}.db"],
    ["skillbook", "list", "--book", "x" * 300],
    ["skillbook", "stats", "--book", f"sqlite:///{NOT_UTF8}.db"],
    ["skillbook", "search", NOT_UTF8, *BOOK],
    ["skillbook", "search", f"OPEN({NOT_UTF8})", *BOOK],
    ["skillbook", "search", "an arc", "--count", HUGE, *BOOK],
    ["skillbook", "show", HUGE, *BOOK],
    ["skillbook", "edit", HUGE, "words", *BOOK],
    ["skillbook", "remove", HUGE, *BOOK],
    ["skillbook", "rollback", HUGE, *BOOK],
    ["skillbook", "diff", HUGE, *BOOK],
    ["skillbook", "diff", "1", HUGE, *BOOK],
    ["skillbook", "history", "--last", HUGE, *BOOK],
    ["skillbook", "forget", "x" * 30_000, "--yes", *BOOK],
]


@pytest.fixture(scope="module", autouse=True)
def quickly():
    with stood_in():
        yield


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_example(tmp_path / "book.db", notes=2)
    (tmp_path / "loop").symlink_to("loop")
    return tmp_path


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(command)[:60].replace(NOT_UTF8, "NOT_UTF8"))
def test_an_argument_that_cannot_be_used_is_refused_in_one_line(command, place):
    code, out, err = run(command)
    assert list(faults_of(code, out, err)) == [] and code != 0, (code, err[-500:])


def test_an_export_replaces_a_link_that_leads_to_itself(place):
    code, out, err = run(["skillbook", "export", "--out", "loop", *BOOK])
    assert (code, list(faults_of(code, out, err))) == (0, [])
    assert (place / "loop").read_text().startswith('{"record": "book"')


@pytest.mark.parametrize(
    "command",
    [
        ["evaluate", "experiment.yaml", "--out", "file"],
        ["evaluate", "experiment.yaml", "--out", "file/folder"],
        ["study", "run", "experiment.yaml", "--out", "file/folder"],
        ["skillbook", "export", "--out", "file/export.jsonl", *BOOK],
        ["skillbook", "check", "--rescue", "file/rescued.db", *BOOK],
        ["run", "experiment.yaml", "--task", "open-the-fridge", "--out", "file"],
    ],
    ids=" ".join,
)
def test_a_file_where_a_folder_should_be_is_named(command, place):
    (place / "file").write_text("a file")
    (place / "experiment.yaml").write_text("llm: offline\nteacher: simulated\nsuite: tabletop\n")
    code, out, err = run(command)
    assert code in (1, 2) and list(faults_of(code, out, err)) == [], (code, err)
    assert "file" in err.splitlines()[-1] and "bug" not in err, err
    assert (place / "file").read_text() == "a file"


@pytest.mark.parametrize(
    ("filter_by", "named"),
    [
        (["list", "--who", "ANA0"], "no person 'ANA0'; did you mean 'ana0'?"),
        (["list", "--key", "OPEN(dor)"], "no key 'OPEN(dor)'; did you mean 'OPEN(door)'?"),
        (["history", "OPEN(dor)"], "no key 'OPEN(dor)'; did you mean 'OPEN(door)'?"),
        (["list", "--who", "ana0", "--key", "open(the door)"], ""),
    ],
)
def test_a_filter_that_finds_nothing_names_what_is_close(filter_by, named, place):
    code, _, err = run(["skillbook", *filter_by, *BOOK])
    assert code == 0 and (named in err if named else "memo: " not in err), err
