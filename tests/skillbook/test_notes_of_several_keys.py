"""A note that was said of several keys is one entry, which each of them has."""

from __future__ import annotations

import json

import pytest

from memo_core.cli.main import main
from memo_core.skillbook import consolidating, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import merge_notes
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.skillbook.writing.functions import SAME_WORDS
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore
from tests.support.cluster_books import clustering, new_book, teach

OVEN, FRIDGE, JAR = "OPEN(oven)", "OPEN(fridge)", "OPEN(jar)"
SLOWLY = "Slowly, from the side."


@pytest.fixture
def book():
    with new_book() as opened:
        yield opened


def say_twice(book: Skillbook) -> tuple[int, int]:
    return teach(book, OVEN, SLOWLY, who="ana")[0], teach(book, FRIDGE, "slowly,  from the side", who="ben")[0]


def keys_of(book: Skillbook, number: int, keys: tuple[str, ...] = (OVEN, FRIDGE, JAR)) -> list[str]:
    return [key for key in keys if number in [entry.id for entry in book.entries(key=key)]]


def shown(book: Skillbook, subtask: str) -> list[tuple[str, str]]:
    """Key and text of the corrections for a subtask."""
    return [(one.key, one.text) for one in book.retrieve(subtask).corrections]


def test_the_same_words_under_several_keys_become_one_note_that_each_key_has(book) -> None:
    first, second = say_twice(book)
    book.note_use([second], True, FRIDGE)
    [made] = merge_notes(book)
    [note] = book.entries()
    assert (made.entries_before, made.entries_after, [e.id for e in made.members]) == (2, 1, [first, second])
    assert (str(note.key), note.text, note.uses, book.sources([note.id])) == (OVEN, "slowly,  from the side", 1, [1, 2])
    assert keys_of(book, note.id) == [OVEN, FRIDGE]
    assert keys_of(book, note.id, ("open(the fridge)",)), "in any spelling"
    revision = history.revision(book, made.revision)
    assert revision.reason == SAME_WORDS and revision.count("superseded") == 2
    assert shown(book, OVEN) == [(OVEN, note.text)] and shown(book, FRIDGE) == [(FRIDGE, note.text)]
    assert [one.under for key in (OVEN, FRIDGE) for one in book.retrieve(key).corrections] == ["", FRIDGE]
    assert book.retrieve(FRIDGE).corrections[0].key_score == pytest.approx(1.0)
    assert merge_notes(book) == merge_notes(book, again=True) == [] and not book.problems()


def test_other_words_and_words_under_one_key_stay(book) -> None:
    teach(book, OVEN, SLOWLY, SLOWLY.upper())
    teach(book, FRIDGE, "Fast.")
    assert merge_notes(book) == []


def test_a_later_note_with_the_same_words_joins_under_its_key_or_another(book) -> None:
    say_twice(book)
    merge_notes(book)
    [before] = book.entries()
    teach(book, FRIDGE, SLOWLY, who="cleo")
    [made] = merge_notes(book)
    [note] = book.entries()
    assert made.members[0].id == before.id and keys_of(book, note.id) == [OVEN, FRIDGE]
    teach(book, JAR, SLOWLY)
    merge_notes(book)
    [note] = book.entries()
    assert keys_of(book, note.id) == [OVEN, FRIDGE, JAR] and book.sources([note.id]) == [1, 2, 3, 4]


def test_clustering_leaves_it_and_the_other_notes_of_its_keys_alone(book) -> None:
    say_twice(book)
    merge_notes(book)
    [note] = book.entries()
    assert list(consolidating.clusters(book, unchanged=True)) == []
    teach(book, FRIDGE, "Hold the handle.", "Do hold the handle.")
    both = json.dumps({"entries": [{"text": "Hold the handle.", "from": [1, 2]}], "dropped": []})
    list(clustering(book, [both]).condense_all())
    assert {entry.text for entry in book.entries(key=FRIDGE)} == {note.text, "Hold the handle."}
    assert [entry.id for entry in book.entries(key=OVEN)] == [note.id]


def test_it_is_undone_and_done_again(book) -> None:
    say_twice(book)
    before = book.entries()
    [made] = merge_notes(book)
    [note] = book.entries()
    undone = history.roll_back(book, made.revision)
    assert book.entries() == before and merge_notes(book) == [], "what somebody took back is not done again"
    assert shown(book, FRIDGE)[0] == (FRIDGE, before[1].text)
    history.roll_back(book, undone.id)
    assert book.entries() == [note] and keys_of(book, note.id) == [OVEN, FRIDGE]
    book.forget("ana")
    assert [(str(e.key), e.id) for e in book.entries()] == [(FRIDGE, before[1].id)], "ben's own note is there again"


def test_an_edited_note_keeps_its_keys(book) -> None:
    say_twice(book)
    merge_notes(book)
    edited = book.edit(book.entries()[0].id, "Very slowly.", "cleo")
    assert keys_of(book, edited.id) == [OVEN, FRIDGE] and (FRIDGE, "Very slowly.") in shown(book, FRIDGE)
    book.remove(edited.id, "cleo")
    assert book.entries(key=FRIDGE) == [] and [e.id for e in book.entries(key=FRIDGE, superseded=True)][-1] == edited.id


def test_what_a_person_said_last_is_retrieved_first_also_as_a_note_of_several_keys() -> None:
    settings = RetrievalSettings(corrections=1)
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), settings) as book:
        teach(book, FRIDGE, "Open the fridge fridge fridge.")
        teach(book, OVEN, SLOWLY)
        teach(book, FRIDGE, SLOWLY)
        assert shown(book, FRIDGE) == [(FRIDGE, SLOWLY)]
        merge_notes(book)
        assert shown(book, FRIDGE) == [(FRIDGE, SLOWLY)]


def test_keys_of_a_note_that_are_joined_become_one_and_come_apart_again(book) -> None:
    say_twice(book)
    merge_notes(book)
    [note] = book.entries()
    consolidating.add_alias(book, FRIDGE, JAR)
    assert keys_of(book, note.id, (OVEN, JAR)) == [OVEN, JAR] and shown(book, FRIDGE) == [(JAR, note.text)]
    [joined] = [one for one in history.revisions(book) if one.reason.startswith("joined")]
    history.roll_back(book, joined.id)
    assert keys_of(book, note.id) == [OVEN, FRIDGE]
    consolidating.add_alias(book, FRIDGE, OVEN)
    assert keys_of(book, note.id, (OVEN,)) == [OVEN] and not book.problems()
    assert consolidating.clusters(book, unchanged=True) == []
    history.roll_back(book, history.revisions(book)[-1].id)
    assert keys_of(book, note.id) == [OVEN, FRIDGE]


def test_a_listing_of_a_further_key_has_it(tmp_path, capsys) -> None:
    path = str(tmp_path / "book.db")
    with new_book(path) as book:
        say_twice(book)
        merge_notes(book)
    with pytest.raises(SystemExit):
        main(["skillbook", "list", "--book", path, "--key", FRIDGE, "--json"])
    assert len(json.loads(capsys.readouterr().out)["entries"]) == 1


def test_a_note_that_is_retrieved_under_one_of_its_keys_is_not_cut_under_another() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(cut=0.999)) as book:
        say_twice(book)
        merge_notes(book)
        for subtask in (OVEN, FRIDGE):
            found = book.retrieve(subtask)
            assert len(found.corrections) == 1 and found.cut == ()
