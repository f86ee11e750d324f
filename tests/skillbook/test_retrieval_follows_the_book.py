"""Retrieval follows every change of the book, also by another process."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from memo_core.skillbook import consolidating, exchange, history, track_record
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.rules import Condensed, Merged
from memo_core.skillbook.history import CannotRollBack
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.key_index import read_keys
from memo_core.skillbook.retrieval.provenance import Provenance, provenance_of
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.skillbook.store import queries
from memo_core.skillbook.vectors.key_vectors import KeyVectors, Wording
from memo_core.skillbook.vectors.text_vectors import TextVectors
from memo_core.skillbook.writing.bulk_adding import Lesson
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

KEYS = ("OPEN(microwave)", "CLOSE(microwave)", "PICK(cup)", "PLACE(cup, shelf)", "PUSH(box)")
STEPS = (
    "teach",
    "many",
    "template",
    "trial",
    "use",
    "cluster",
    "rollback",
    "forget",
    "alias",
    "edit",
    "remove",
    "merge",
    "reembed",
    "pending",
)


def change(book: Skillbook, step: str, number: int) -> None:
    key, who = KEYS[number % len(KEYS)], f"person {number % 3}"
    if step == "teach":
        feedback = book.record_feedback("words", who, subtask=key)
        book.add_lessons(feedback, key, [f"lesson {chr(65 + number)}"] * (number % 3), ["mind it"] * (number % 2))
    elif step == "many":
        lessons = [Lesson("words", who, Key.parse(key), (f"{'abc'[n]} {chr(65 + number)}",)) for n in range(3)]
        exchange.add_many(book, [*lessons, Lesson("words", who, Key("wipe", (f"thing {number}",)), ("slowly",))])
    elif step == "template":
        approval = book.record_feedback("", who, kind="approval", subtask=key)
        book.add_template(approval, key, f"def f(x={number}):\n    pass")
    elif step == "trial" and (templates := book.entries("template")):
        track_record.note_trial(book, templates[number % len(templates)].id, f"seed {number % 2}", number % 3 == 0)
    elif step == "use" and (there := book.entries(key=key)):
        book.note_use([one.id for one in there], number % 2 == 0, key)
    elif step == "cluster":
        for cluster in consolidating.clusters(book, unchanged=True)[: number % 3]:
            together = Merged(cluster.members[0].text, tuple(range(1, len(cluster.members) + 1)))
            consolidating.condense(book, cluster, Condensed((together,)), "somebody")
    elif step == "rollback" and (known := history.revisions(book)):
        with contextlib.suppress(CannotRollBack):
            history.roll_back(book, known[number % len(known)].id)
    elif step == "forget" and who in book.people():
        book.forget(who)
    elif step == "alias":
        consolidating.add_alias(book, key, KEYS[(number + 1) % len(KEYS)])
    elif step == "edit" and (there := book.entries()):
        entry = there[number % len(there)]
        book.edit(
            entry.id,
            f"{entry.text}\nnumber = {number}" if entry.kind == "template" else f"lesson {chr(65 + number)} edited",
            who,
        )
    elif step == "remove" and (there := book.entries()):
        book.remove(there[number % len(there)].id, who)
    elif step == "merge":
        with Skillbook("sqlite://") as other:
            change(other, "many", number)
            exchange.merge(book, exchange.export(other), "another laboratory")
    elif step == "pending":
        book.record_feedback("words", who)


def test_a_book_that_another_process_changes_serves_what_a_fresh_one_would(tmp_path: Path) -> None:
    path = str(tmp_path / "b.db")
    settings = RetrievalSettings(cut=-1.0)
    with Skillbook(path, FakeEmbedder(), settings=settings) as book, Skillbook(path, FakeEmbedder()) as other:
        change(other, "many", 1)
        for number, step in enumerate(STEPS * 2):
            if step != "reembed":
                change(other, step, number)
            with Skillbook(path, FakeEmbedder(), settings=settings) as fresh:
                for key in (*KEYS, "WIPE(thing 1)"):
                    assert book.retrieve(key) == fresh.retrieve(key)


def test_who_said_what_is_served_is_told_from_memory_as_it_is_in_the_book(tmp_path: Path) -> None:
    """Also of clusters, which were said by several people, of edited entries, and after forgetting."""
    path = str(tmp_path / "b.db")
    with Skillbook(path, FakeEmbedder()) as book, Skillbook(path, FakeEmbedder()) as other:
        several = 0
        for number, step in enumerate(STEPS[:-2] * 3):
            change(other, step, number)
            for key in (*KEYS, "WIPE(thing 1)"):
                served = book.retrieve(key).served
                known = provenance_of(other.database, [one.entry.id for one in served])
                assert [one.provenance for one in served] == [known.get(one.entry.id, Provenance()) for one in served]
                several += sum(len(one.provenance.who) > 1 for one in served)
    assert several


def test_who_approves_a_template_once_more_is_told_at_once(tmp_path: Path) -> None:
    """Though that changes nothing in what is served."""
    path, key, code = str(tmp_path / "b.db"), KEYS[0], "def f():\n    pass"
    with Skillbook(path, FakeEmbedder()) as book, Skillbook(path, FakeEmbedder()) as other:
        for people in (("ana",), ("ana", "bob"), ("ana", "bob", "cid")):
            approval = other.record_feedback("", people[-1], kind="approval", subtask=key)
            other.add_template(approval, key, code)
            [template] = book.retrieve(key).templates
            assert template.provenance.who == people
        assert book.generation() == 1


# -- scoring every key ------------------------------------------------------------------------------------------------
_NAME = st.sampled_from(["cup", "red cup", "box", "shelf", "oven door", "table", "lid"])
_KEY = st.builds(
    lambda verb, objects: Key(verb, tuple(objects)),
    st.sampled_from(["open", "grab", "pick", "put", "place", "wipe"]),
    st.lists(_NAME, min_size=1, max_size=3, unique=True),
)


@settings(max_examples=40, deadline=None)
@given(st.lists(_KEY, min_size=1, max_size=40, unique=True), _KEY, st.floats(0.01, 10))
def test_every_key_is_scored_by_the_papers_formula(keys: list[Key], query: Key, weight: float) -> None:
    with Skillbook("sqlite://", FakeEmbedder()) as book:
        exchange.add_many(book, [Lesson("no", "ana", key, ("gently",)) for key in keys])
        texts = TextVectors(book.database, FakeEmbedder())
        vectors = KeyVectors(texts, Wording(), default_actions())
        [action], [thing] = vectors.get([query])
        known = read_keys(book.database, texts, vectors)
        assert set(known.keys) == set(keys) and known.total == len(keys)
        actions, objects = vectors.get(known.keys)
        scores = known.score(action, thing, (weight, 1.0))
        r = (weight * (actions @ action).astype(float) + (objects @ thing).astype(float)) / (weight + 1)
        assert np.allclose(scores.scores, r, atol=2e-6)
        assert np.all(np.diff(scores.scores[scores.best_first]) <= 0)
        assert np.all((scores.exchanged >= 0) & (scores.exchanged <= 1))


def test_a_store_is_opened_only_where_texts_count() -> None:
    class Never(FakeStore):
        def open(self) -> None:
            raise AssertionError("it was opened")

    with Skillbook("sqlite://", FakeEmbedder(), Never(), RetrievalSettings.preset("paper")) as book:
        change(book, "many", 1)
        assert book.retrieve("WIPE(thing 1)").corrections
    with Skillbook("sqlite://", FakeEmbedder(), Never()) as book:
        change(book, "many", 1)
        with pytest.raises(AssertionError):
            book.retrieve("WIPE(thing 1)")


def test_clusters_are_read_one_after_the_other_and_what_is_clustered_is_not_read_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with Skillbook("sqlite://", FakeEmbedder()) as book:
        exchange.add_many(book, [Lesson("no", "ana", Key.parse(key), ("gently", "slowly")) for key in KEYS])
        read: list[str] = []
        original = queries.entries_where

        def spying(connection: object, *conditions: object) -> list[object]:
            found = original(connection, *conditions)  # type: ignore[arg-type]
            read.extend(str(one.key) for one in found if one.kind != "template")
            return found  # type: ignore[return-value]

        monkeypatch.setattr(queries, "entries_where", spying)
        clusters = consolidating.each_cluster(book)
        assert len(clusters) == len(KEYS) and read == []
        first = next(iter(clusters))
        assert set(read) == {str(first.key)}
        for cluster in clusters:
            consolidating.condense(
                book, cluster, Condensed(tuple(Merged(m.text, (n,)) for n, m in enumerate(cluster.members, 1))), "x"
            )
        read.clear()
        assert (
            len(consolidating.each_cluster(book)) == 0 and list(consolidating.each_cluster(book)) == [] and read == []
        )
        change(book, "teach", 1)
        [again] = consolidating.each_cluster(book)
        assert set(read) == {str(again.key)} and len(again.members) == 3
