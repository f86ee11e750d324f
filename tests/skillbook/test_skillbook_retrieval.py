"""What a subtask is served: r exactly, opposites never, ties by text, uses and recency; the index is only derived."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import attrs
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings, strategies as st
from memo_vectorstore.faiss_store import FaissStore
from memo_vectorstore.settings import FaissSettings

from memo_core.errors import InvalidArgument
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook import consolidating, history, stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.retriever import Retrieval, RetrievalSettings, as_text
from memo_core.skillbook.retrieval.score import key_score
from memo_core.skillbook.store.database import SkillbookError
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

EVERYTHING = RetrievalSettings(
    cut=-1.0, corrections=1000, general=1000, templates=1000, general_floor=-1.0, ranking="key"
)
ASKING = attrs.evolve(EVERYTHING, ranking="key-and-text")  # the store
BY_KEY = RetrievalSettings(ranking="key")
KEYS = (
    "OPEN(microwave)",
    "CLOSE(microwave)",
    "OPEN(fridge)",
    "PICK(red cube)",
    "PLACE(red cube, cabinet)",
    "PUSH(box)",
)


def teach(book: Skillbook, key: str, *corrections: str, general: tuple[str, ...] = (), who: str = "ana") -> list[int]:
    feedback = book.record_feedback("some words", who, subtask=key)
    return [entry.id for entry in book.add_lessons(feedback, key, corrections, general)]


def template(book: Skillbook, key: str, code: str) -> int:
    return book.add_template(book.record_feedback("", "ana", kind="approval", subtask=key), key, code).id


@pytest.fixture
def book(tmp_path: Path) -> Iterator[Skillbook]:
    with Skillbook(str(tmp_path / "book.db"), FakeEmbedder(), FakeStore(), EVERYTHING) as opened:
        for key in KEYS:
            teach(opened, key, f"How to do {key}.", "Slowly.")
            template(opened, key, f"def work():\n    '''{key}'''")
        yield opened


def texts(found: Retrieval) -> list[str]:
    return [one.text for one in found.corrections]


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.floats(1e-3, 1e3),
    st.floats(1e-3, 1e3),
    st.sampled_from([*KEYS, "GRAB(cube, drawer)", "STACK(a, b, c)"]),
    st.sampled_from([FakeStore, lambda: FaissStore(FaissSettings())]),
)
def test_r_is_exact_for_any_weights(
    book: Skillbook, one: float, two: float, query: str, make: type[VectorStore]
) -> None:
    chosen = RetrievalSettings(one, two, cut=-1.0, corrections=1000, templates=1000, ranking="key")
    with Skillbook(book.url, FakeEmbedder(), make(), chosen, read_only=True) as again:
        found = again.retrieve(query)
    assert found.corrections
    for served in (*found.corrections, *found.templates):
        wanted = (one * served.action_cosine + two * served.objects_cosine) / (one + two)
        assert (
            served.score
            == pytest.approx(wanted, abs=1e-9)
            == key_score(served.action_cosine, served.objects_cosine, one, two)
        )
        assert -1.001 <= served.action_cosine <= 1.001 and -1.001 <= served.objects_cosine <= 1.001
    scores = [served.score for served in found.corrections]
    assert all(later <= earlier + 1e-6 for earlier, later in itertools.pairwise(scores))
    assert [served.rank for served in found.corrections] == list(range(1, len(scores) + 1))


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0, 0.5), st.floats(0, 0.5), st.sampled_from([*KEYS, "GRAB(cube, drawer)", "SLOWLY(box)"]))
def test_s_is_made_of_the_terms_that_are_told(book: Skillbook, by_text: float, by_terms: float, query: str) -> None:
    chosen = attrs.evolve(ASKING, text_weight=by_text, overlap_weight=by_terms)
    with Skillbook(book.url, FakeEmbedder(), FakeStore(), chosen, read_only=True) as again:
        found = again.retrieve(query).corrections
    embed = FakeEmbedder()
    asked = embed.embed([as_text(Key.parse(query))])[0]
    assert len(found) > 3
    for one in found:
        text, key = embed.embed([one.text, as_text(one.entry.key)]) @ asked
        assert one.text_similarity == pytest.approx(text, abs=1e-5) and 0 <= one.overlap <= 1
        words = by_text * (text + key) / 2 + by_terms * one.overlap
        wanted = (1 - by_text - by_terms) * one.key_score + (1 - one.exchanged) * words
        assert one.score == pytest.approx(wanted, abs=1e-5)
    scores = [served.score for served in found]
    assert all(later <= earlier + 1e-6 for earlier, later in itertools.pairwise(scores))


_VERB = st.sampled_from(sorted(default_actions().groups))


@settings(max_examples=30, deadline=None)
@given(st.lists(_VERB, min_size=1, max_size=8, unique=True), _VERB, st.integers(1, 5))
@example(["open fingers", "sweep"], "close fingers", 1)
def test_opposites_are_never_served(verbs: list[str], asked: str, limit: int) -> None:
    chosen = RetrievalSettings(cut=-1.0, corrections=limit, templates=limit, newest=False)
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), chosen) as book:
        for verb in verbs:
            teach(book, f"{verb}(box)", f"to {verb}")
            template(book, f"{verb}(box)", f"def f(): '{verb}'")
        found = book.retrieve(f"{asked}(box)")
    actions = default_actions()
    opposite = {verb for verb in verbs if actions.opposite(verb, asked)}
    served = {one.entry.key.action for one in (*found.corrections, *found.templates)}
    assert not served & opposite
    assert {Key.parse(c.key).action for c in found.cut if c.rule == "opposite action"} <= opposite
    assert len(found.corrections) == min(limit, len(verbs) - len(opposite)), "an opposite took somebody's place"


def test_the_same_action_on_the_same_object_comes_first(book: Skillbook) -> None:
    assert book.retrieve("OPEN(fridge)").corrections[0].key == "OPEN(fridge)"
    assert book.retrieve("grab(the red cube)").corrections[0].key == "PICK(red cube)", (
        "synonyms share their key's score"
    )


def test_below_the_cut_is_reported_not_served(book: Skillbook) -> None:
    with Skillbook(book.url, FakeEmbedder(), FakeStore(), attrs.evolve(BY_KEY, cut=0.999), read_only=True) as strict:
        found = strict.retrieve("OPEN(microwave)")
    assert {s.key for s in found.corrections} == {"OPEN(microwave)"}
    rules = {c.key: c.rule for c in found.cut}
    assert rules["CLOSE(microwave)"] == "opposite action" and rules["OPEN(fridge)"] == "below the cut 0.999"


def test_limits_hold_and_what_is_beyond_is_reported(book: Skillbook) -> None:
    teach(book, "OPEN(microwave)", *(f"advice {n}" for n in range(30)))
    with Skillbook(book.url, FakeEmbedder(), FakeStore(), RetrievalSettings(corrections=4, templates=1)) as small:
        found = small.retrieve("OPEN(microwave)")
    assert len(found.corrections) == 4 and len(found.templates) == 1
    beyond = [c for c in found.cut if c.rule == "beyond the first 4 corrections" and c.key == "OPEN(microwave)"]
    assert [c.entries for c in beyond] == [28]
    with Skillbook(
        book.url, FakeEmbedder(), FakeStore(), RetrievalSettings(corrections=0, general=0, templates=0)
    ) as none:
        assert none.retrieve("OPEN(microwave)").served == ()


def test_ties_go_to_the_text_most_like_the_subtask() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as book:
        teach(book, "OPEN(jar)", "Invoices are due.", "open jar", "open the jar with a quarter turn")
        assert texts(book.retrieve("OPEN(jar)"))[0] == "open jar"


def test_synonyms_share_one_ranking() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), BY_KEY) as book:
        for key in ("PICK(red cube)", "GRAB(red cube)", "TAKE(red cube)"):
            teach(book, key, f"invoices {key}", f"pick the red cube {key}")
        found = book.retrieve("PICK(red cube)").corrections
    assert all("pick the red cube" in s.text for s in found[:3]) and len(found) == 6
    similar = [s.text_similarity for s in found]
    assert similar == sorted(similar, reverse=True)


def test_then_to_confirmed_uses_then_to_the_newest() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(corrections=2, newest=False)) as book:
        ids = [teach(book, "OPEN(jar)", "Turn it.", who=f"p{n}")[0] for n in range(4)]
        assert [s.entry.id for s in book.retrieve("OPEN(jar)").corrections] == [ids[3], ids[2]]
        book.note_use([ids[0]], success=True)
        book.note_use([ids[1]], success=False)
        found = book.retrieve("OPEN(jar)").corrections
        assert [s.entry.id for s in found] == [ids[0], ids[3]]
        assert (found[0].entry.uses, found[0].entry.confirmed_uses) == (1, 1)
        assert (book.entry(ids[1]).uses, book.entry(ids[1]).confirmed_uses) == (1, 0)


def test_general_statements_are_ranked_by_their_own_text() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(general=2)) as book:
        teach(book, "PICK(cup)", general=("Invoices are due.", "wipe table gently", "When you wipe a table press."))
        found = book.retrieve("WIPE(table)")
        assert found.corrections == () and len(found.general) == 2
        assert found.general[0].text == "wipe table gently" and found.general[0].key == "*"
        assert "Invoices are due." not in [s.text for s in found.general]


def test_roles_are_told_apart() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), EVERYTHING) as book:
        teach(book, "PLACE(cup, plate)", "cup on plate")
        teach(book, "PLACE(plate, cup)", "plate on cup")
        teach(book, "PLACE(cup, shelf)", "cup on shelf")
        teach(book, "PLACE(cup)", "cup anywhere")
        found = book.retrieve("PLACE(cup, plate)").corrections
    cosines = {s.text: s.objects_cosine for s in found}
    assert found[0].text == "cup on plate" and cosines["cup on plate"] == pytest.approx(1.0, abs=1e-5)
    assert max(cosines["plate on cup"], cosines["cup on shelf"], cosines["cup anywhere"]) < 0.95
    assert cosines["cup on shelf"] > cosines["plate on cup"], "what is moved is the same"


def test_what_was_said_of_exchanged_roles_has_no_words_in_common_with_the_subtask() -> None:
    by_words = RetrievalSettings(cut=-1.0, text_weight=0.5, overlap_weight=0.5)
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), by_words) as book:
        for key in ("PUT(lid, pan)", "PUT(pan, lid)", "PUT(egg, box)", "PUT(pan, box)", "PUT(lid)"):
            teach(book, key, "Put the lid and the pan close together.")
        found = {one.key: one for one in book.retrieve("PUT(lid, pan)").corrections}
    assert found["PUT(pan, lid)"].score == pytest.approx(0.0, abs=1e-6), "the weights leave words alone to decide"
    assert found["PUT(lid, pan)"].score > max(one.score for key, one in found.items() if key != "PUT(lid, pan)")
    assert found["PUT(pan, lid)"].exchanged == pytest.approx(1.0, abs=1e-5)
    assert 0 < found["PUT(pan, box)"].exchanged < 1, "what goes in is where the other goes"
    assert found["PUT(lid)"].exchanged == found["PUT(egg, box)"].exchanged == 0


def test_the_event_says_what_was_served_and_why(book: Skillbook) -> None:
    found = book.retrieve("OPEN(fridge)")
    event = found.event()
    assert event.subtask == "OPEN(fridge)" and len(event.served) == len(found.served)
    assert event.served[0].score == found.corrections[0].score
    assert ("CLOSE(microwave)", pytest.approx(0.9, abs=0.2), "opposite action") in [tuple(c) for c in event.cut]


def test_near_spellings_lead_to_one_key(book: Skillbook) -> None:
    ids = teach(book, "OPEN(micro wave oven)", "Mind the cable.")
    consolidating.add_alias(book, "OPEN(micro wave oven)", "OPEN(microwave)")
    assert str(book.entry(ids[0]).key) == "OPEN(microwave)"
    later = teach(book, "OPEN(micro wave oven)", "Mind the plug.")
    assert str(book.entry(later[0]).key) == "OPEN(microwave)"
    found = book.retrieve("OPEN(the micro wave oven)")
    assert found.corrections[0].key == "OPEN(microwave)" and found.corrections[0].score == pytest.approx(1, abs=1e-5)


# -- the index is derived ----------------------------------------------------------------------------------------------
def test_new_entries_are_served_at_once_also_from_another_process_s_write(book: Skillbook) -> None:
    before = len(book.retrieve("OPEN(oven)").corrections)
    with Skillbook(book.url, FakeEmbedder()) as other:
        teach(other, "OPEN(oven)", "The hinge is below.")
    assert len(book.retrieve("OPEN(oven)").corrections) == before + 1


def test_an_index_is_rebuilt_only_when_it_has_to_be(book: Skillbook) -> None:
    store = FakeStore()
    for expected in (1, 1):
        with Skillbook(book.url, FakeEmbedder(), store, ASKING) as again:
            again.retrieve("OPEN(oven)")
            again.retrieve("PUSH(box)")
        assert store.rebuilt == expected, "an index that was up to date was rebuilt"
    assert len(store) == 2 * len(KEYS) + len(KEYS), "every correction and template"
    ids = teach(book, "OPEN(oven)", "new")
    with Skillbook(book.url, FakeEmbedder(), store, ASKING) as again:
        assert "new" in texts(again.retrieve("OPEN(oven)"))
    assert store.rebuilt == 1 and ids[0] in store.ids(), "one entry came, and all was made anew"
    history.roll_back(book, history.revisions(book, last=1)[0].id)
    with Skillbook(book.url, FakeEmbedder(), store, ASKING) as again:
        assert "new" not in texts(again.retrieve("OPEN(oven)"))
    assert store.rebuilt == 1 and ids[0] not in store.ids(), "what was retired stayed"
    consolidating.add_alias(book, "OPEN(fridge)", "OPEN(microwave)")  # not told by revisions
    with Skillbook(book.url, FakeEmbedder(), store, ASKING) as again:
        again.retrieve("OPEN(oven)")
    assert store.rebuilt == 1, "the same entries under another key"
    with Skillbook("sqlite://", FakeEmbedder(), store, ASKING) as other:
        teach(other, "OPEN(oven)", "of another book")
        assert texts(other.retrieve("OPEN(oven)")) == ["of another book"]
    assert store.rebuilt == 2, "an index of another book was kept"


@pytest.mark.parametrize("damage", ["flip", "truncate", "empty", "garbage", "missing", "another book's"])
def test_a_corrupt_index_file_is_made_anew(book: Skillbook, tmp_path: Path, damage: str) -> None:
    file = tmp_path / "keys.faiss"

    def ask() -> list[tuple[str, float]]:
        with Skillbook(book.url, FakeEmbedder(), FaissStore(FaissSettings(str(file))), ASKING) as again:
            return [(s.text, s.score) for s in again.retrieve("OPEN(oven)").corrections]

    wanted = ask()
    body = bytearray(file.read_bytes())
    if damage == "flip":
        body[len(body) // 2] ^= 255
    elif damage == "another book's":
        with Skillbook(
            str(tmp_path / "b"), FakeEmbedder(), FaissStore(FaissSettings(str(tmp_path / "k"))), ASKING
        ) as b:
            for key in KEYS:
                teach(b, f"{key[:-1]}, table)", "x", "y")
                template(b, f"{key[:-1]}, table)", "x")
            b.retrieve("OPEN(oven)")
        body = bytearray((tmp_path / "k").read_bytes())
    damaged = {"truncate": bytes(body[:100]), "empty": b"", "garbage": b"\x00" * 500}.get(damage, bytes(body))
    file.write_bytes(damaged)
    if damage == "missing":
        file.unlink()
    assert ask() == [(text, pytest.approx(r, abs=1e-6)) for text, r in wanted]
    assert len(file.read_bytes()) > 500, "the index was not written again"


class _Lying(FakeStore):
    """Says it has what it has not, raises, or gives scores out of thin air."""

    def __init__(self, lie: str) -> None:
        super().__init__()
        self.lie = lie

    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        ids, products = super().search(query, count)
        if self.lie == "scores":
            return ids, products + 5
        if self.lie == "order":
            return ids[::-1], products[::-1]
        if self.rebuilt < 2 and self.lie == "raises once":
            raise RuntimeError("segment lost")
        if self.rebuilt < 2 and self.lie == "unknown ids once":
            return ids + 1000, products
        return ids, products


@pytest.mark.parametrize("lie", ["scores", "order", "raises once", "unknown ids once"])
def test_a_store_can_miss_but_never_lie(book: Skillbook, lie: str) -> None:
    with Skillbook(book.url, FakeEmbedder(), FakeStore(), ASKING) as honest:
        wanted = [(s.text, s.score) for s in honest.retrieve("OPEN(oven)").corrections]
    with Skillbook(book.url, FakeEmbedder(), _Lying(lie), ASKING) as again:
        assert [(s.text, s.score) for s in again.retrieve("OPEN(oven)").corrections] == [
            (text, pytest.approx(r, abs=1e-6)) for text, r in wanted
        ]


# -- embedders and settings --------------------------------------------------------------------------------------------
def test_vectors_are_cached_in_the_book(book: Skillbook) -> None:
    book.retrieve("OPEN(fridge)")
    fresh = FakeEmbedder()
    with Skillbook(book.url, fresh, FakeStore(), EVERYTHING) as again:
        again.retrieve("OPEN(fridge)")
    assert fresh.embedded == 0


def test_the_same_model_under_another_path_goes_on_with_the_book(tmp_path: Path) -> None:
    """The title of a model is the name of its folder; the fingerprint tells whether it is the same."""
    here, moved, other = (FakeEmbedder(), FakeEmbedder(), FakeEmbedder())
    here.name, moved.name, other.name = "all-MiniLM-L6-v2#0123456789ab", "model#0123456789ab", "model#ba9876543210"
    path = str(tmp_path / "book.db")
    with Skillbook(path, here) as book:
        book.add_lessons(book.record_feedback("turn it", "ana"), "OPEN(jar)", ["Turn it."])
        found = [served.text for served in book.retrieve("OPEN(jar)").served]
    with Skillbook(path, moved) as book:
        assert [served.text for served in book.retrieve("OPEN(jar)").served] == found and not moved.embedded
        book.add_lessons(book.record_feedback("pull it", "ana"), "OPEN(box)", ["Pull it."])
        assert book.retrieve("OPEN(box)").served and stats.stats_of(book).embedder == here.name
    with pytest.raises(SkillbookError, match="reembed"):
        Skillbook(path, other).open()


def test_another_embedder_is_refused_with_the_command_and_can_take_over(book: Skillbook, tmp_path: Path) -> None:
    from memo_core.skillbook.vectors.reembedding import reembed

    wanted = texts(book.retrieve("OPEN(fridge)"))
    other = FakeEmbedder(64)
    with pytest.raises(SkillbookError, match="memo skillbook reembed"):
        Skillbook(book.url, other, FakeStore()).open()
    assert reembed(book.url, other) > 0
    with Skillbook(book.url, other, FakeStore(), EVERYTHING) as again:
        assert sorted(texts(again.retrieve("OPEN(fridge)"))) == sorted(wanted)
        assert stats.stats_of(again).embedder == other.name
    with pytest.raises(SkillbookError):
        Skillbook(book.url, FakeEmbedder(), FakeStore()).open()


def test_an_embedder_of_another_dimension_under_the_same_name_is_refused(book: Skillbook) -> None:
    book.retrieve("OPEN(fridge)")
    impostor = FakeEmbedder(64)
    impostor.name = FakeEmbedder().name
    with Skillbook(book.url, impostor, FakeStore()) as again, pytest.raises(SkillbookError, match="dimensions"):
        again.retrieve("UNSEEN(thing)")


@pytest.mark.parametrize(
    "wrong",
    [{"lambda_action": 0}, {"lambda_objects": -1}, {"lambda_action": float("nan")}, {"cut": 2}, {"corrections": -1},
     {"general": 1.5}, {"action_phrase": "no place"}, {"object_phrase": "{} {}"}],
)  # fmt: skip
def test_settings_that_cannot_be_right_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidArgument, match=next(iter(wrong)).split("_")[0]):
        RetrievalSettings(**wrong).wording  # type: ignore[arg-type]  # noqa: B018


def test_a_book_without_backends_says_what_is_missing(tmp_path: Path) -> None:
    with Skillbook(str(tmp_path / "b.db")) as book, pytest.raises(SkillbookError, match="without an embedder"):
        book.retrieve("OPEN(jar)")


def test_an_empty_book_serves_nothing_and_adds_nothing() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), read_only=True) as book:
        found = book.retrieve("OPEN(jar)")
    assert found.served == () and found.cut == ()


def test_what_is_served_says_who_said_it_when_and_of_what() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), EVERYTHING) as book:
        said = book.record_feedback("turn it", "ana", subtask="OPEN(jar)", when=100.0)
        book.add_lessons(said, "OPEN(jar)", ["Turn it."], ["Go slowly."])
        later = book.record_feedback("no, further", "ben", subtask="PICK(lid)", when=200.0)
        book.add_lessons(later, "UNSCREW(jar)", ["Turn it further."])
        found = book.retrieve("OPEN(jar)")
        bottle = book.retrieve("OPEN(bottle)")
    by_text = {one.text: one for one in found.served}
    first, other, general = by_text["Turn it."], by_text["Turn it further."], by_text["Go slowly."]
    assert (first.provenance.who, first.provenance.when, first.provenance.subtask) == (("ana",), 100.0, "OPEN(jar)")
    assert (other.provenance.who, other.provenance.subtask) == (("ben",), "PICK(lid)"), "said of another subtask"
    assert first.alike == "the same subtask" and other.alike == "another action on the same thing"
    assert general.provenance.who == ("ana",) and general.alike == "" and general.key_score == 0.0
    assert first.key_score == pytest.approx(1.0, abs=1e-5) and other.key_score < first.key_score
    assert {one.alike for one in bottle.corrections} == {"the same action on something else", "something else"}
