"""The entries in memory: what is served is what scoring every entry would serve, whoever changes the book."""

from __future__ import annotations

import random
from pathlib import Path

import attrs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from memo_benchmarks.exact_serving import EveryEntry
from memo_benchmarks.generated_book import BookSize, fill, keys_of
from memo_benchmarks.skillbook import WordVectors
from test_skillbook_retrieval_cache import KEYS, STEPS, change

from memo_core.skillbook import best_entries, entry_index, finding, queries
from memo_core.skillbook.action_relations import default_actions
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.bulk_adding import Lesson
from memo_core.skillbook.keys import Key
from memo_core.skillbook.newest import newest_of_people
from memo_core.skillbook.retrieval import Retrieval, RetrievalSettings
from memo_core.skillbook.scene_context import SubtaskContext
from memo_core.skillbook.shared_terms import GRIP, RELEASE, Terms
from memo_core.skillbook.speakers import Speakers
from memo_core.skillbook.term_lists import TermLists, nth_largest
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

SIZE = BookSize(2400, 120, general=0.01)
PLAIN = RetrievalSettings(newest=False)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("best") / "book.db"
    with Skillbook(str(made), WordVectors()) as book:
        fill(book, SIZE)
        book.prepare()
    return made


@pytest.fixture
def pruned(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small book is read as a large one is: most entries are never scored."""
    monkeypatch.setattr(best_entries, "_KEYS_FIRST", 8)
    monkeypatch.setattr(best_entries, "_FIRST", 2)


@pytest.mark.parametrize(("cut", "rounded"), [(0.85, False), (0.85, True), (0.99, False), (0.99, True)])
@pytest.mark.usefixtures("pruned")
def test_what_is_served_is_what_scoring_every_entry_serves(
    path: Path, monkeypatch: pytest.MonkeyPatch, cut: float, rounded: bool
) -> None:
    """Where all keys pass the cut, and where only the subtask's own key does or none."""
    if rounded:
        monkeypatch.setattr(entry_index, "EXACT", 10)
        monkeypatch.setattr(entry_index, "_MORE", 20)
    chosen = attrs.evolve(PLAIN, cut=cut)
    every = EveryEntry(str(path), WordVectors(), chosen)
    asked = [key for key in [*keys_of(SIZE)[:25], Key.parse("POKE(anvil)")] if not every.grips(key)]
    scored: list[int] = []
    similar = entry_index.EntryIndex.similar

    def counting(index: entry_index.EntryIndex, positions: np.ndarray, meant: np.ndarray) -> np.ndarray:
        scored.append(len(positions))
        return similar(index, positions, meant)

    monkeypatch.setattr(entry_index.EntryIndex, "similar", counting)
    tolerance = 1e-3 if rounded else 1e-5
    with Skillbook(str(path), WordVectors(), FakeStore(), chosen, read_only=True) as book:
        for key in asked:
            scores, least = every.served(key)
            served = book.retrieve(key).corrections
            assert len(served) == min(20, len(scores)), key
            best = sorted(scores.values(), reverse=True)[: len(served)]
            assert [one.score for one in served] == pytest.approx(best, abs=tolerance), key
            assert all(scores[one.entry.id] >= least - tolerance for one in served)
    every.close()
    assert sum(scored) < 0.8 * len(asked) * SIZE.entries


@pytest.mark.parametrize("cut", [0.85, 0.99])
@pytest.mark.usefixtures("pruned")
def test_where_what_people_said_last_takes_every_place_templates_are_served_as_by_an_exact_store(
    path: Path, monkeypatch: pytest.MonkeyPatch, cut: float
) -> None:
    asked = [*keys_of(SIZE)[:40], Key.parse("POKE(anvil)")]
    searches: list[int] = []

    class Store(FakeStore):
        def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
            searches.append(count)
            return super().search(query, count)

    def served(corrections: int) -> list[list[tuple[int, float, float]]]:
        chosen = RetrievalSettings(cut=cut, corrections=corrections)
        with Skillbook(str(path), WordVectors(), Store(), chosen, read_only=True) as book:
            return [_told(book.retrieve(key)) for key in asked]

    found = served(corrections=3)
    assert 0 < len(searches) < len(asked) / 2, "where it can find nothing that is served the store is not asked"
    monkeypatch.setattr(finding, "_COMPARED", 0)
    searches.clear()
    assert served(corrections=3) == found and len(searches) == len(asked)


def test_what_was_forgotten_leaves_a_store_that_is_not_asked(tmp_path: Path) -> None:
    store, key = FakeStore(), Key.parse("OPEN(microwave)")
    with Skillbook(str(tmp_path / "b.db"), FakeEmbedder(), store, RetrievalSettings(corrections=1)) as book:
        book.add_many([Lesson("no", who, key, (f"{who} pulls it",)) for who in ("ana", "bob", "cid")])
        assert len(book.retrieve(key).corrections) == len(store) == 3
        book.forget("ana")
        assert len(book.retrieve(key).corrections) == len(store) == 2


@pytest.mark.usefixtures("pruned")
def test_what_others_write_is_served_at_the_next_question(tmp_path: Path) -> None:
    file, key = str(tmp_path / "b.db"), Key.parse("OPEN(microwave)")
    lessons = [
        Lesson("no", "ana", Key("open", (f"thing {n}",)), tuple(f"hold part {m} of {n}" for m in range(9)))
        for n in range(30)
    ]
    with Skillbook(file, WordVectors(), settings=PLAIN) as mine, Skillbook(file, WordVectors()) as other:
        other.add_many(lessons)
        assert "open microwave" not in {one.text for one in mine.retrieve(key).corrections}
        other.add_many([Lesson("no", "bob", key, ("open microwave",))])
        assert mine.retrieve(key).corrections[0].text == "open microwave"
        [entry] = other.entries(key=key)
        other.edit(entry.id, "open the microwave slowly", "bob")
        texts = [one.text for one in mine.retrieve(key).corrections]
        assert texts[0] == "open the microwave slowly" and "open microwave" not in texts
        other.forget("bob")
        assert not {"open microwave", "open the microwave slowly"} & {one.text for one in mine.retrieve(key).served}


@pytest.mark.parametrize("room", [2, 1000])
@pytest.mark.usefixtures("pruned")
def test_a_book_that_is_followed_serves_what_a_fresh_one_would(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    """With room for what comes, and without, so that everything is read anew again and again."""
    monkeypatch.setattr(entry_index, "_MORE", room)
    path = str(tmp_path / "b.db")
    with Skillbook(path, FakeEmbedder()) as book, Skillbook(path, FakeEmbedder()) as other:
        for number, step in enumerate(("many", *STEPS[:-2], *STEPS[:-2]), start=3):
            change(other, step, number)
            with Skillbook(path, FakeEmbedder()) as fresh:
                for key in (*KEYS, "WIPE(thing 1)"):
                    assert _told(book.retrieve(key)) == _told(fresh.retrieve(key)), (step, key)


def _told(found: Retrieval) -> list[tuple[int, float, float]]:
    return [(one.entry.id, round(one.score, 5), one.overlap) for one in found.served]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.lists(
            st.sampled_from(
                ["Open", "opening", "the", "shaker", "\0", "don't", "it's", "7", "knob", "é", "grip", "drop it"]
            )
        ),
        max_size=9,
    ),
    st.sampled_from(["OPEN(shaker)", "ROTATE(knob)", "POKE(anvil)"]),
    st.integers(0, 9),
)
def test_terms_as_numbers_overlap_as_words_do(texts: list[list[str]], subtask: str, first: int) -> None:
    terms = Terms(default_actions())
    written = [" ".join(words) for words in texts]
    lists = TermLists(terms)
    lists.add(written[:first])
    lists.add(written[first:])
    wanted = terms.of_subtask(Key.parse(subtask), SubtaskContext(parts=("knob",), holding=False))
    each = [terms.overlap(wanted, text) for text in written]
    backwards = np.arange(len(written))[::-1]
    assert lists.overlap(backwards, wanted).tolist() == pytest.approx(each[::-1])
    about = lists.have(backwards, GRIP) & ~lists.have(backwards, RELEASE)
    assert about.tolist() == [terms.about_gripping(text) for text in written[::-1]]


def test_who_spoke_last_in_memory_is_who_spoke_last_in_the_book(tmp_path: Path) -> None:
    """Of people who said several things, of remarks that became several notes, and of more than may be served."""
    path, keys = str(tmp_path / "b.db"), [Key.parse("OPEN(microwave)"), Key.parse("PULL(drawer)")]
    draw = random.Random(3)
    with Skillbook(path, FakeEmbedder()) as book:
        speakers = Speakers(book._database)
        for number in range(40):
            who, key = draw.choice(["ana", "bob", "cid", f"guest {number}"]), draw.choice(keys)
            notes = [f"note {number} {n}" for n in range(draw.choice((1, 2, 5)))]
            book.add_many([Lesson("no", who, key, tuple(notes))])
            if number == 30:
                book.forget("ana")
            speakers.follow(anew=number == 30)
            if number % 5:
                continue
            for key in keys:
                mine = [one.id for one in book.entries("correction", key)]
                with book._database.read() as connection:
                    [known] = [i for i, one in queries.keys_by_id(connection).items() if one == key] or [-1]
                for most in (3, 20):
                    expected = newest_of_people(book._database, [known], most)
                    assert speakers.newest(np.array(mine, np.int64), most) == expected
                    assert not mine or expected


@settings(deadline=None)
@given(st.lists(st.floats(-1, 1, width=32), min_size=1, max_size=300), st.data())
def test_the_nth_largest_number_is_that_of_all_in_order(values: list[float], data: st.DataObject) -> None:
    count = data.draw(st.integers(1, min(12, len(values))))
    for several in (values, values * 5):
        assert nth_largest(np.array(several), count) == sorted(several)[-count]
