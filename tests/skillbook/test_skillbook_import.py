"""Merging books: twice changes nothing, both ways make them equal, and what was withdrawn stays away."""

from __future__ import annotations

import json
import pickle
import random
import subprocess
import sys
import time
import tracemalloc
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from memo_core.cli import skillbook_transfer
from memo_core.cli.main import main
from memo_core.errors import UnknownName
from memo_core.skillbook import consolidating, exchange, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.rules import Condensed, Merged
from memo_core.skillbook.model.entries import GLOBAL_KEY, Reaction
from memo_core.skillbook.sharing.authors_books import NotALorebook, read_lorebook
from memo_core.skillbook.sharing.import_records import BadImport, ImportRecords
from memo_core.skillbook.sharing.safe_pickle import UnsafePickle
from tests.support.cluster_books import approve, new_book, teach, teach_general


def content(book: Skillbook) -> dict[str, object]:
    """What a book holds, without numbers."""
    records = list(exchange.export(book))
    said = {r["id"]: (r["words"], r["who"], r["subtask"]) for r in records if r["record"] == "feedback"}
    return {
        "feedback": Counter((*said[r["id"]], r["kind"], r["status"]) for r in records if r["record"] == "feedback"),
        "entries": Counter(
            (
                r["kind"],
                r["action"],
                tuple(r["objects"]),
                r["text"],
                r["superseded_by"] is None,
                r["uses"],
                tuple(sorted(said[source] for source in r["sources"])),
            )
            for r in records
            if r["record"] == "entry"
        ),
        "aliases": sorted((r["spelling"], r["action"]) for r in records if r["record"] == "alias"),
    }


def exported(book: Skillbook) -> list[dict[str, object]]:
    """As a file would hold it."""
    return [json.loads(json.dumps(record)) for record in exchange.export(book)]


def test_importing_twice_changes_nothing() -> None:
    with new_book() as one, new_book() as other:
        teach(one, "OPEN(jar)", "turn it", "hold the glass")
        teach_general(one, "be gentle")
        approve(one, "OPEN(jar)")
        one.record_feedback("still pending", "bob", subtask="OPEN(box)")
        teach(other, "OPEN(jar)", "their own")
        first = exchange.merge(other, exported(one), "lab one")
        assert (first.feedback, first.entries, first.known) == (5, 4, 0)
        before = exported(other)
        again = exchange.merge(other, exported(one), "lab one, by another name")
        assert not again.changed and again.known == 9 and exported(other) == before
        assert {e.text for e in other.entries("correction")} == {"turn it", "hold the glass", "their own"}
        assert [f.words for f in other.pending_feedback()] == ["still pending"]
        served = other.retrieve("OPEN(jar)")
        assert {s.text for s in served.corrections} == {"turn it", "hold the glass", "their own"}


def test_a_dry_run_says_the_same_and_changes_nothing() -> None:
    with new_book() as one, new_book() as other:
        teach(one, "OPEN(jar)", "turn it")
        before = exported(other)
        said = exchange.merge(other, exported(one), "lab", dry_run=True)
        assert said.entries == 1 and exported(other) == before
        assert exchange.merge(other, exported(one), "lab") == said


def test_where_it_comes_from_is_known() -> None:
    with new_book() as one, new_book() as other:
        [entry] = teach(one, "OPEN(jar)", "turn it", who="ana")
        exchange.merge(other, exported(one), "the lab in Ghent")
        [book] = exchange.imported_books(other)
        assert book.name == "the lab in Ghent" and book.first == book.last > 1e9
        [mine] = other.entries()
        assert exchange.origin(other, mine.id) == (book.book, str(entry)) and other.people() == ["ana"]


def _word(rng: random.Random) -> str:
    return "".join(rng.choices("abcdefghij", k=8))


def _act(rng: random.Random, book: Skillbook, who: str) -> None:
    key = f"{rng.choice(['OPEN', 'LIFT'])}({rng.choice(['jar', 'box'])})"
    valid = [e for e in book.entries() if e.kind == "correction"]
    what = rng.randrange(7)
    if what <= 2 or not valid:
        teach(book, key, f"{who} says {_word(rng)}", who=rng.choice([who, "ana"]))
    elif what == 3:
        approve(book, key, f"def f(): return {rng.randrange(10**6)}", who=who)
    elif what == 4:
        book.note_use([rng.choice(valid).id], rng.random() < 0.5, key)
    elif what == 5:
        clusters = [
            c for c in consolidating.clusters(book, unchanged=True) if len(c.members) > 1 and c.key != GLOBAL_KEY
        ]
        if clusters:
            cluster = rng.choice(clusters)
            text = min((m.text for m in cluster.members), key=len)
            consolidating.condense(
                book, cluster, Condensed((Merged(text, tuple(range(1, len(cluster.members) + 1))),)), "test"
            )
    else:
        revisions = [r.id for r in history.revisions(book) if not r.reason.startswith("imported")]
        try:
            history.roll_back(book, rng.choice(revisions))
        except Exception as error:
            assert type(error).__name__ in ("CannotRollBack", "UnknownName", "IndexError"), error


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**9))
def test_two_books_that_import_each_other_come_to_hold_the_same(seed: int) -> None:
    rng = random.Random(seed)
    with new_book() as one, new_book() as other:
        for _ in range(rng.randrange(1, 4)):
            for book, who in ((one, "olga"), (other, "otto")):
                for _ in range(rng.randrange(6)):
                    _act(rng, book, who)
            if rng.random() < 0.5:
                files = exported(one), exported(other)  # both before either imports
                exchange.merge(one, files[1], "other"), exchange.merge(other, files[0], "one")
            else:
                exchange.merge(other, exported(one), "one")
        for _ in range(3):
            exchange.merge(one, exported(other), "other")
            exchange.merge(other, exported(one), "one")
        assert content(one) == content(other)
        assert not exchange.merge(one, exported(other), "other").changed and one.problems() == other.problems() == []
        for book in (one, other):
            served = Counter(e.key for e in book.entries("template"))
            assert all(count == 1 for count in served.values()), served


def test_three_books_by_way_of_one_another() -> None:
    with new_book() as a, new_book() as b, new_book() as c:
        teach(a, "OPEN(jar)", "of a")
        exchange.merge(b, exported(a), "a")
        teach(b, "OPEN(jar)", "of b")
        exchange.merge(c, exported(b), "b")
        assert not exchange.merge(c, exported(a), "a").changed, "what came by way of b is known"
        exchange.merge(a, exported(c), "c")
        assert content(a) == content(b) == content(c)


# -- withdrawing -------------------------------------------------------------------------------------------------------
def test_what_was_withdrawn_here_does_not_come_back() -> None:
    with new_book() as one, new_book() as other:
        teach(one, "OPEN(jar)", "of ana", who="ana")
        teach(one, "OPEN(jar)", "of bob", who="bob")
        exchange.merge(other, exported(one), "one")
        assert other.forget("ana").feedback == 1
        assert not exchange.merge(other, exported(one), "one").changed
        assert other.people() == ["bob"] and [e.text for e in other.entries()] == ["of bob"]
        assert not exchange.merge(one, exported(other), "other").changed and one.people() == ["ana", "bob"]


def test_what_was_withdrawn_where_it_was_said_goes_everywhere(tmp_path: Path) -> None:
    path = tmp_path / "other.db"
    with new_book() as one, new_book(str(path)) as other:
        teach(one, "OPEN(jar)", "zebrawords of ana", who="ana")
        teach(one, "OPEN(jar)", "of bob", who="bob")
        exchange.merge(other, exported(one), "one")
        other.retrieve("OPEN(jar)")
        old = exported(one)
        one.forget("ana")
        told = exchange.merge(other, exported(one), "one")
        assert told.withdrawn == 1 and other.people() == ["bob"]
        assert [s.text for s in other.retrieve("OPEN(jar)").corrections] == ["of bob"]
        assert not exchange.merge(other, old, "one").changed, "an older file brings it back"
        assert not exchange.merge(one, exported(other), "other").changed and one.people() == ["bob"]
    assert b"zebra" not in b"".join(file.read_bytes() for file in tmp_path.iterdir())


def test_a_book_withdraws_nobody_elses_words() -> None:
    with new_book() as one, new_book() as other:
        teach(one, "OPEN(jar)", "of ana", who="ana")
        file = exported(one)
        origin = next(r for r in file if r["record"] == "feedback")["origin"]
        with new_book() as third:
            claims = [*exported(third), {"record": "withdrawn", "kind": "feedback", "origin": origin}]
            assert not exchange.merge(one, claims, "third").changed
            exchange.merge(other, file, "one")
            assert not exchange.merge(other, claims, "third").changed
        assert one.people() == other.people() == ["ana"]


def test_of_a_cluster_of_two_peoples_words_the_others_note_is_there_again_when_one_withdraws() -> None:
    with new_book() as one, new_book() as other, new_book() as later:
        teach(one, "OPEN(jar)", "turn it", who="ana")
        teach(one, "OPEN(jar)", "turn it round", who="bob")
        book, *rest = exported(one)
        del book["counts"]
        exchange.merge(later, [book, *(r for r in rest if r["record"] != "entry")], "one")
        [cluster] = consolidating.clusters(one)
        consolidating.condense(one, cluster, Condensed((Merged("turn it", (1, 2)),)), "test")
        exchange.merge(other, exported(one), "one")
        assert [e.text for e in other.entries()] == ["turn it"]
        other.forget("ana")
        assert [e.text for e in other.entries()] == ["turn it round"] and other.people() == ["bob"]
        later.forget("ana")
        exchange.merge(later, exported(one), "one")
        assert [e.text for e in later.entries()] == ["turn it round"], "what was merged with withdrawn words came in"
        other.forget("bob")
        assert other.entries(superseded=True) == []
        assert not exchange.merge(other, exported(one), "one").changed
        with pytest.raises(UnknownName):
            other.forget("bob")


def test_an_export_with_lines_missing_is_refused() -> None:
    with new_book() as one, new_book() as other:
        teach(one, "OPEN(jar)", "turn it")
        teach(one, "OPEN(box)", "lift it")
        whole = exported(one)
        for kind in ("feedback", "entry", "revision"):
            gap = next(n for n, record in enumerate(whole) if record["record"] == kind)
            with pytest.raises(BadImport, match=f"1 records of kind '{kind}' where the first one says 2"):
                exchange.merge(other, whole[:gap] + whole[gap + 1 :], "one")
        with pytest.raises(BadImport, match="lines are missing"):
            exchange.merge(other, whole[:1], "one")
        assert other.entries() == []
        assert exchange.merge(other, whole, "one").changed


# -- bad files ---------------------------------------------------------------------------------------------------------
BOOK = {"record": "book", "format": 2, "book": "b" * 32}
KEYED = {"action": "open", "objects": ["jar"]}


@pytest.mark.parametrize(
    ("records", "said"),
    [
        ([], "nothing in it"),
        ([{"record": "entry"}], "does not begin with a book"),
        ([BOOK | {"format": 5}], "format 5.*update"),
        ([BOOK, {"record": "entri"}], "record 2: 'entri' is no kind"),
        ([BOOK, {"record": "feedback", "id": 1}], "feedback: kind: it is missing"),
        ([BOOK, {"record": "alias", "spelling": "OPEN(x)", "action": "open", "objects": []}], "record 2: alias"),
        ([BOOK, {"record": "uses", "entry": 4, "uses": 1, "confirmed_uses": 1, **KEYED}], "entry 4 is not in the file"),
        ([BOOK, {"record": "uses", "entry": True, "uses": 1, "confirmed_uses": 1, **KEYED}], "entry: 'True' is wrong"),
        ([BOOK, {"record": "withdrawn", "kind": "feedback", "origin": ["a"]}], "expected \\[book, number\\]"),
        (["text"], "begin with a book"),
    ],
)
def test_what_is_no_book_is_named_and_changes_nothing(records: list, said: str) -> None:
    with new_book() as book:
        before = exported(book)
        with pytest.raises(BadImport, match=said):
            exchange.merge(book, records, "x")
        assert exported(book) == before


HOSTILE = (
    "x\ud800",
    "a\0b",
    [],
    {},
    ["x"],
    None,
    True,
    -1,
    2**63,
    2**80,
    10**400,
    1e300,
    float("nan"),
    float("inf"),
    "",
    0,
    1.5,
    [[]],
)


def test_a_file_with_anything_in_it_is_refused_with_its_line_or_leaves_a_whole_book() -> None:
    with new_book() as one:
        teach(one, "OPEN(jar)", "turn it", "turn it round")
        teach_general(one, "be gentle")
        approve(one, "OPEN(jar)")
        first = one.entries("correction")[0]
        one.read_back(first.feedback, [Reaction(first.id, "reworded", "turn it slowly")])
        consolidating.add_alias(one, "OPEN(jar)", "OPEN(glass)")
        whole = exported(one)
    draw, refused = random.Random(8), 0
    for _ in range(400):
        records = [dict(record) for record in whole]
        for _ in range(draw.randint(1, 2)):
            record = draw.choice(records)
            name = draw.choice([*record, "origin", "phase", "ordinal"])
            record[name] = draw.choice(HOSTILE)
        if draw.random() < 0.1:
            records.insert(draw.randrange(1, len(records)), dict(whole[0]))
        with new_book() as book:
            try:
                exchange.merge(book, records, "x")
            except BadImport as error:
                refused += 1
                assert list(exchange.export(book))[1:] == [] and str(error).isprintable()
            else:
                assert not book.problems() and json.dumps(list(exchange.export(book)), allow_nan=False).encode()
                for revision in history.revisions(book):
                    time.localtime(revision.time)
                book.retrieve("OPEN(jar)")
    assert refused > 200


@pytest.mark.parametrize("field", ["time", "created"])
def test_a_time_that_no_calendar_has_is_refused(field: str) -> None:
    with new_book() as one, new_book() as other:
        teach(one, "OPEN(jar)", "turn it")
        records = exported(one)
        [record, *_] = [r for r in records if field in r and r["record"] in ("revision", "entry")]
        record[field] = 1e300
        with pytest.raises(BadImport, match=f"{field}: '1e[+]300' is wrong"):
            exchange.merge(other, records, "x")


def test_a_book_is_not_merged_with_itself() -> None:
    with new_book() as book, pytest.raises(BadImport, match="this very book"):
        exchange.merge(book, exported(book), "x")


# -- lorebooks ---------------------------------------------------------------------------------------------------------
V = np.ones(4, dtype=np.float32)
ITEMS = [
    ("OPEN(cabinet) table cube cabinet", "Pull along an arc."),
    ("open( the Cabinet ) table", "Approach from the left."),
    ("PUT(cube, cabinet) table cube cabinet", "Lower it first."),
    ("PUT (cube,cabinet) table", "Lower it first."),  # the same text under the same key
    ("GENERAL table cube cabinet", "Look before you move."),
    ("TEMPLATE OPEN(cabinet)", "def open_cabinet(): ..."),
    ("OPEN(drawer) table", ""),
    ("OPEN(drawer) table", None),
    ("LIFT cube", "no brackets"),
]


def lorebook(items: list, pairs: bool = True) -> bytes:
    vectors = [(V, V) if pairs else V for _ in items]
    return pickle.dumps({"vectors": vectors, "metadata": [{"key": k, "value": v} for k, v in items]})


@pytest.mark.parametrize("pairs", [True, False])
def test_a_lorebook_is_read(pairs: bool) -> None:
    read = read_lorebook(lorebook(ITEMS, pairs), "authors", 1e9)
    assert (read.corrections, read.general, read.templates) == (3, 1, 1)
    assert (read.keys, read.spellings, read.empty, read.repeated, read.unread) == (2, 4, 2, 1, ("LIFT cube",))
    assert read.vectors == 9
    with new_book() as book:
        assert exchange.merge(book, read.records, "authors").entries == 5
        assert not exchange.merge(book, read_lorebook(lorebook(ITEMS[::-1]), "authors", 2e9).records, "authors").changed
        more = lorebook([*ITEMS, ("OPEN(cabinet)", "Slower.")])
        assert exchange.merge(book, read_lorebook(more, "authors", 2e9).records, "authors").entries == 1
        served = book.retrieve("OPEN(cabinet)")
        assert {s.text for s in served.corrections} == {"Pull along an arc.", "Approach from the left.", "Slower."}
        assert [s.text for s in served.templates] == ["def open_cabinet(): ..."]
        assert [s.text for s in served.general] == ["Look before you move."]
        assert book.forget("authors").entries == 6 and book.entries(superseded=True) == []


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([1], "no list"),
        ({"metadata": {}}, "no list"),
        ({"metadata": [{"key": 3}]}, r"\[0\] has no text"),
        ({"metadata": [{"key": "GENERAL", "value": 3}]}, r"\[0\]\[.value.\] is a int"),
        ({"metadata": [], "vectors": 3}, "is a int, not a list"),
        ({"metadata": [], "vectors": [1]}, "has 1 items, metadata has 0"),
    ],
)
def test_plain_data_that_is_no_lorebook_is_named(value: object, said: str) -> None:
    with pytest.raises(NotALorebook, match=said):
        read_lorebook(pickle.dumps(value), "x", 0.0)


# -- from the shell ----------------------------------------------------------------------------------------------------
def memo(*arguments: object, code: int = 0) -> str:
    command = [sys.executable, "-m", "memo_core.cli.main", "skillbook", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == code and "Traceback" not in done.stderr, done.stderr
    return done.stdout if code == 0 else done.stderr


@pytest.mark.process
def test_export_and_import_from_the_shell(tmp_path: Path) -> None:
    one, other, file = tmp_path / "one.db", tmp_path / "other.db", tmp_path / "one.jsonl"
    with Skillbook(str(one)) as book:
        teach(book, "OPEN(jar)", "turn it, in a line\u2028and another")
    memo("export", "--book", one, "--out", file)
    assert json.loads(memo("import", file, "--book", other, "--dry-run", "--json"))["entries"] == 1
    assert "brought" in memo("import", file, "--book", other, "--whose", "lab one")
    assert "nothing new" in memo("import", file, "--book", other)
    assert json.loads(memo("books", "--book", other, "--json"))["books"][0]["name"] == "lab one"
    assert "nothing is wrong" in memo("check", "--book", other)
    (tmp_path / "authors.pkl").write_bytes(lorebook(ITEMS))
    said = json.loads(memo("import", tmp_path / "authors.pkl", "--from", "lorebook", "--book", other, "--json"))
    assert said["entries"] == 5 and said["read"]["unread_count"] == 1
    hostile = tmp_path / "hostile.pkl"
    touch = str(tmp_path / "ran").encode()
    hostile.write_bytes(b"\x80\x02cos\nsystem\n(U" + bytes([len(touch) + 6]) + b"touch " + touch + b"tR.")
    assert "it asks for os.system" in memo("import", hostile, "--from", "lorebook", "--book", other, code=1)
    assert not (tmp_path / "ran").exists()
    assert "it asks for os.system" in memo("import", hostile, "--book", other, code=1), "the format is recognised"
    plain = [{"key": key, "value": value} for key, value in ITEMS]
    (tmp_path / "authors.json").write_text(json.dumps({"vectors": [], "metadata": plain}))
    said = json.loads(memo("import", tmp_path / "authors.json", "--book", other, "--json"))
    assert said["entries"] == 0 and said["known"] > 0 and said["read"]["items"] == len(ITEMS)
    assert "did you mean 'lorebook'" in memo("import", hostile, "--from", "lorebok", "--book", other, code=2)


ITEM = {"key": "OPEN(jar) table", "value": "Turn it."}
FILES = {
    "vectors first": (json.dumps({"vectors": [[0.123456789] * 9000], "metadata": [ITEM]}).encode(), 0, "read 1 items"),
    "indented": (json.dumps({"vectors": [], "metadata": [ITEM]}, indent=2).encode(), 0, "read 1 items"),
    "with a mark of UTF-8": (b"\xef\xbb\xbf" + json.dumps({"metadata": [ITEM]}).encode(), 0, "read 1 items"),
    "UTF-16": (json.dumps({"metadata": [ITEM]}).encode("utf-16"), 0, "read 1 items"),
    "a pickle": (pickle.dumps({"metadata": [ITEM], "vectors": []}, 2), 0, "read 1 items"),
    "a large pickle": (pickle.dumps({"metadata": [ITEM] + [{"key": "x" * 99_999}]}), 0, "read 2 items"),
    "a pickle of text": (pickle.dumps({"metadata": [ITEM]}, 0), 2, "is no export of a book; expected"),
    "JSON cut off": (b'{"vectors": [], "metadata": [{"key": "OPEN(jar)', 1, "is no JSON"),
    "another JSON": (b'{"metadata": {"key": "OPEN(jar)"}}', 1, 'has no list "metadata"'),
    "a list": (json.dumps([ITEM]).encode(), 2, "is no export of a book; expected"),
    "a table": (b"key,value\nOPEN(jar),Turn it.\n", 2, "is no export of a book; expected"),
    "a sentence": (b"hello there\n", 2, "is no export of a book; expected"),
    "a count": (b"count,value\n1,2\n", 2, "is no export of a book; expected"),
    "a book itself": (b"SQLite format 3\0" + bytes(100_000), 2, "`memo skillbook export --book "),
    "empty": (b"", 2, "there is nothing in it"),
}


@pytest.mark.parametrize("name", FILES)
def test_what_a_file_is_is_recognised_and_only_a_pickle_is_called_one(name: str, tmp_path: Path, capsys) -> None:
    data, code, said = FILES[name]
    file = tmp_path / "lorebook.json"
    file.write_bytes(data)
    with pytest.raises(SystemExit) as ended:
        main(["skillbook", "import", str(file), "--book", str(tmp_path / "book.db")])
    shown = capsys.readouterr()
    assert (ended.value.code, said in shown.out + shown.err) == (code, True), shown
    assert "refused" not in shown.err and (code == 0 or shown.err.count("\n") == 1), shown.err


def test_damage_in_a_pickle_that_says_it_is_one_is_the_pickles(tmp_path: Path, capsys) -> None:
    file = tmp_path / "lorebook.pkl"
    file.write_bytes(lorebook(ITEMS)[:200])
    with pytest.raises(SystemExit):
        main(["skillbook", "import", str(file), "--book", str(tmp_path / "book.db")])
    assert "this pickle is refused: it is damaged" in capsys.readouterr().err


def peak_of_reading(folder: Path, count: int) -> int:
    """Bytes that checking a file of ``count`` entries takes at most."""
    with new_book() as book:
        teach(book, "OPEN(jar)", "turn it")
        head, feedback, revision, entry = (
            next(record for record in exported(book) if record["record"] == kind)
            for kind in ("book", "feedback", "revision", "entry")
        )
    file = folder / f"{count}.jsonl"
    with file.open("w") as lines:
        lines.write(json.dumps(head | {"counts": None}) + "\n")
        for number in range(1, count + 1):
            said = feedback | {"id": number, "words": f"{number} " * 100}
            made = {
                "id": number,
                "feedback": number,
                "revision": number,
                "sources": [number],
                "text": f"{number} " * 100,
            }
            for record in (said, revision | {"id": number}, entry | made):
                lines.write(json.dumps(record | {"origin": ["elsewhere", number]}) + "\n")
    tracemalloc.start()
    try:
        ImportRecords(skillbook_transfer._lines(file))
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_file_is_read_a_line_at_a_time_and_memory_holds_little_of_it(tmp_path: Path) -> None:
    """300 000 lines were 690 MB: now an id and an offset of each record are kept, whatever its text."""
    few, many = (peak_of_reading(tmp_path, count) for count in (300, 3_000))
    size = (tmp_path / "3000.jsonl").stat().st_size - (tmp_path / "300.jsonl").stat().st_size
    assert many - few < 400 * 2_700 and many - few < size / 5, (few, many, size)


def test_unsafe_is_an_error_of_ours() -> None:
    with pytest.raises(UnsafePickle):
        read_lorebook(b"\x80\x02cos\nsystem\n.", "x", 0.0)
