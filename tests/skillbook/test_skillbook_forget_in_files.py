"""A person's words leave every file that the book knows of, and what cannot be reached is told."""

from __future__ import annotations

import json
import stat
from pathlib import Path

import pytest

from memo_core.skillbook import consolidating, exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.rules import Condensed, Merged
from memo_core.skillbook.forgetting.scrubbing import WITHDRAWN, Scrubber
from memo_core.testing.fake_embedder import FakeEmbedder

WORDS = 'Nein, the "zebra" handle — pull it, round!'
NOTE = "Pull the zebra handle round."


def held(folder: Path, *words: str) -> list[Path]:
    """Files that hold any of the words, in whatever encoding of JSON."""
    found = []
    for file in sorted(folder.rglob("*")):
        if file.is_file() and any(word.encode() in file.read_bytes() for word in words):
            found.append(file)
    return found


@pytest.fixture
def book(tmp_path: Path) -> Skillbook:
    opened = Skillbook(str(tmp_path / "book.db"), FakeEmbedder()).open()
    said = opened.record_feedback(WORDS, "ana", subtask="OPEN(door)", run="r1")
    opened.add_lessons(said, "OPEN(door)", [NOTE])
    other = opened.record_feedback("go slowly, please", "ben", subtask="OPEN(door)", run="r1")
    opened.add_lessons(other, "OPEN(door)", ["Move slowly."])
    return opened


def run_folder(path: Path) -> Path:
    """The kinds of files in which a run keeps texts."""
    for name in ("calls", "words", "code"):
        (path / name).mkdir(parents=True)
    prompt = f"## What the person said\n> {WORDS}\n\n## Notes\n- {NOTE}\n- Move slowly.\n"
    answer = json.dumps({"corrections": [NOTE], "general": []}, ensure_ascii=True)
    call = {"messages": [{"role": "user", "text": prompt}], "answer": {"text": answer}, "phase": "feedback"}
    (path / "calls/001-feedback.json").write_text(json.dumps(call))
    (path / "calls/002-plan.json").write_text(json.dumps({"messages": [{"text": "Plan the task."}]}))
    events = [{"event": "FeedbackGiven", "who": "ana", "words": WORDS}, {"event": "RunEnded"}]
    (path / "events.jsonl").write_text("".join(json.dumps(one) + "\n" for one in events))
    said = [{"number": 1, "who": "ana", "words": WORDS}, {"number": 1, "who": "ben", "words": "go slowly, please"}]
    (path / "words/all.jsonl").write_text("".join(json.dumps(one) + "\n" for one in said))
    (path / "code/attempt-2.py").write_text("# Pull the zebra\n# handle round.\nlook()\n")
    (path / "video.mp4").write_bytes(bytes(range(256)))
    return path


def test_no_file_that_the_book_knows_of_holds_the_words_afterwards(book: Skillbook, tmp_path: Path) -> None:
    run = run_folder(tmp_path / "runs/r1")
    recording = tmp_path / "recording.jsonl"
    recording.write_text(json.dumps({"request": {"text": f"words: {WORDS.upper()}"}, "answer": NOTE}) + "\n")
    export = tmp_path / "export.jsonl"
    export.write_text("".join(json.dumps(record) + "\n" for record in exchange.export(book)))
    backup = tmp_path / "book.db.before-5.backup"
    backup.write_bytes((tmp_path / "book.db").read_bytes() + WORDS.encode())
    with Skillbook(str(tmp_path / "rebuilt.db")) as rebuilt:
        rebuilt.record_feedback(WORDS, "ana", subtask="OPEN(door)")
    places = {"run": run, "recording": recording, "export": export, "backup": backup, "book": tmp_path / "rebuilt.db"}
    for kind, path in places.items():
        book.note_place(kind, path)
    assert len(held(tmp_path, "zebra", "ZEBRA")) >= 7

    forgotten = book.forget("ana")
    book.close()

    assert held(tmp_path, "zebra", "ZEBRA", "Nein") == []
    assert forgotten.deleted == (str(backup),) and not backup.exists()
    assert str(run / "calls/001-feedback.json") in forgotten.rewritten
    assert json.loads((run / "calls/001-feedback.json").read_text())["phase"] == "feedback"
    assert "go slowly" in (run / "words/all.jsonl").read_text(), "nobody else's words"
    assert (run / "calls/002-plan.json").read_text() == json.dumps({"messages": [{"text": "Plan the task."}]})
    assert (run / "video.mp4").read_bytes() == bytes(range(256))
    assert any("providers of language models" in line for line in forgotten.unreached)


def test_an_export_stays_one_that_can_be_imported_and_withdraws_the_words_elsewhere(tmp_path: Path) -> None:
    file = tmp_path / "export.jsonl"
    with Skillbook("sqlite://", FakeEmbedder()) as book, Skillbook("sqlite://") as other, Skillbook("sqlite://") as new:
        notes = []
        for who in ("ana", "ben"):
            said = book.record_feedback(f"arc, says {who}", who, subtask="OPEN(door)")
            notes.append(book.add_lessons(said, "OPEN(door)", [f"Arc, says {who}."])[0])
        [cluster] = consolidating.clusters(book)
        consolidating.condense(book, cluster, Condensed((Merged("Arc, says ana and ben.", (1, 2)),)))
        file.write_text("".join(json.dumps(record) + "\n" for record in exchange.export(book)))
        exchange.merge(other, exchange.export(book), "book")
        book.note_place("export", file)
        book.forget("ana")
        records = [json.loads(line) for line in file.read_text().splitlines()]
        exchange.merge(new, records, "book")
        assert [entry.text for entry in new.entries()] == ["Arc, says ben."] == [e.text for e in book.entries()]
        exchange.merge(other, records, "book")
        assert other.people() == ["ben"] and [entry.text for entry in other.entries()] == ["Arc, says ben."]


def test_what_cannot_be_reached_is_told(book: Skillbook, tmp_path: Path) -> None:
    moved, broken = tmp_path / "moved", tmp_path / "broken.db"
    broken.write_text("no book")
    book.note_place("run", moved)
    book.note_place("book", broken)
    further = run_folder(tmp_path / "elsewhere")
    forgotten = book.forget("ana", [further])
    assert held(further, "zebra") == []
    assert any(str(moved) in line and "was it moved" in line for line in forgotten.unreached)
    assert any(str(broken) in line for line in forgotten.unreached)


def test_words_are_found_however_they_are_written_and_nothing_else_is(tmp_path: Path) -> None:
    scrubber = Scrubber([WORDS, "no!", "  "])
    for text in (
        f"He said {WORDS!r}",
        json.dumps({"a": WORDS}),
        json.dumps(json.dumps({"a": WORDS})),
        '> Nein, the\n> "zebra" handle —\n> pull it, round!',
        "NEIN THE ZEBRA HANDLE PULL IT ROUND",
    ):
        assert scrubber.text(text) == WITHDRAWN, text
    assert scrubber.text("> No!\nno problem, move on") == f"{WITHDRAWN}\nno problem, move on"
    assert scrubber.text("the zebra handle") == "the zebra handle"
    quoted = {"not_understood": ["zebra", "grasp"], "note": "zebra"}
    assert scrubber.value(quoted) == {"not_understood": [WITHDRAWN, "grasp"], "note": "zebra"}
    assert scrubber.text("") == "" and scrubber.value({"n": 1.5, "none": None}) == {"n": 1.5, "none": None}


def test_a_rewritten_file_keeps_its_mode_and_an_untouched_one_its_bytes(tmp_path: Path) -> None:
    touched, untouched = tmp_path / "a.json", tmp_path / "b.json"
    touched.write_text(json.dumps({"words": WORDS}))
    touched.chmod(0o640)
    untouched.write_text('{"b":   1}')
    scrubbed = Scrubber([WORDS]).path(tmp_path)
    assert scrubbed.rewritten == (touched,) and stat.S_IMODE(touched.stat().st_mode) == 0o640
    assert untouched.read_text() == '{"b":   1}' and len(list(tmp_path.iterdir())) == 2
