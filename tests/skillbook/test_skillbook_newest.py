"""Of contradicting notes of one person the newer counts, however many notes stand under a key."""

from __future__ import annotations

import attrs
import pytest

from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.skillbook import exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.scene_context import SubtaskContext
from memo_core.skillbook.retrieval.retriever import Retrieval, RetrievalSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

KEY = "OPEN(drawer)"
LATEST = "Straighten your elbow."  # says nothing that the subtask says: its text ranks it last


def say(book: Skillbook, who: str, when: float, *texts: str, key: str = KEY) -> None:
    book.add_lessons(book.record_feedback("no", who, subtask=key, when=when), key, texts)


def many(book: Skillbook, count: int = 50) -> None:
    for n in range(count):
        way = "open the drawer straight" if n % 2 else "open the drawer along an arc"
        say(book, f"person {n % 3}", 100.0 + n, f"To {way}, variant {n}.")


def places(found: Retrieval) -> dict[str, int]:
    return {one.text: one.rank for one in found.corrections}


@pytest.mark.parametrize("ranking", ["key", "key-and-text"])
def test_what_each_person_said_last_is_served_among_fifty_notes(ranking: str) -> None:
    chosen = RetrievalSettings(ranking=ranking, corrections=5)
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), chosen) as book:
        many(book)
        say(book, "person 0", 1000.0, LATEST)
        found = book.retrieve(KEY)
        last = {e.text for e in book.entries() if e.text.startswith(LATEST) or "variant 49" in e.text or "47" in e.text}
    assert len(found.corrections) == 5 and len(last) == 3
    assert last <= set(places(found)), "person 1 said variant 49 last, person 2 variant 47"
    of_one = [one.text for one in found.corrections if one.provenance.who == ("person 0",)]
    assert of_one[0] == LATEST, "nothing that the same person said before comes first"
    assert [one.rank for one in found.corrections] == [1, 2, 3, 4, 5]


def test_the_paper_ranks_by_r_alone() -> None:
    few = attrs.evolve(RetrievalSettings.preset("paper"), corrections=20)
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), few) as book:
        many(book)
        say(book, "person 0", 1000.0, LATEST)
        assert LATEST not in places(book.retrieve(KEY))


def test_everybody_is_heard_once_where_more_people_spoke_than_notes_are_served() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(corrections=4)) as book:
        for n in range(27):
            say(book, f"person {n % 9}", 100.0 + n, f"To open the drawer, variant {n}.", f"Mind the drawer, {n}.")
        found = book.retrieve(KEY)
    assert {one.provenance.who[0] for one in found.corrections} == {f"person {n}" for n in range(9)}
    assert len(found.corrections) == 11, "both notes of the two latest remarks, one of each other"
    assert {int("".join(filter(str.isdigit, one.text))) for one in found.corrections} == set(range(18, 27))


def test_all_notes_of_the_last_remark_count_and_equal_inputs_are_answered_alike() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(corrections=6)) as book:
        many(book)
        say(book, "person 1", 1000.0, LATEST, "Look twice.")
        one, other = book.retrieve(KEY), book.retrieve(KEY)
    assert {LATEST, "Look twice."} <= set(places(one)) and one == other


def test_an_entry_says_whether_its_key_passed_or_it_is_only_a_hint() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(cut=0.99, reach=1.0)) as book:
        say(book, "ana", 1.0, "Pull the drawer.")
        say(book, "ana", 2.0, "The drawer is heavy.", key="WEIGH(parcel)")
        passes = {one.text: one.passes for one in book.retrieve(KEY).corrections}
    assert passes == {"Pull the drawer.": True, "The drawer is heavy.": False}


def test_a_template_is_found_by_what_its_docstring_says() -> None:
    code = 'def swing():\n    """{}"""\n    return 1\n'
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(cut=0.99, reach=1.0)) as book:
        for key, said in (("TUNE(violin)", "Turn the knob."), ("WEIGH(parcel)", "Bend over.")):
            approval = book.record_feedback("", "ana", kind="approval", subtask=key)
            book.add_template(approval, key, code.format(said))
        found = book.retrieve("ROTATE(knob)").templates
        assert [one.key for one in found] == ["TUNE(violin)"]
        assert found[0].overlap == 1.0 and not found[0].passes
        similar = FakeEmbedder().embed(["swing Turn the knob.", "rotate knob"])
        assert found[0].text_similarity == pytest.approx(float(similar[0] @ similar[1]), abs=1e-5)


def node(name: str, label: str, part_of: str | None = None, attributes: tuple[str, ...] = ()) -> Node:
    return Node(name, label, Pose(), (0.1, 0.1, 0.1), part_of=part_of, attributes=attributes)


def scene(*nodes: Node) -> SceneGraph:
    return SceneGraph(nodes, (), Observation(Pose(), 0.08, False))


def test_the_context_names_what_the_scene_shows_of_a_thing_in_other_words() -> None:
    seen = scene(
        node("shaker", "sugar shaker", attributes=("metal",)),
        node("shaker/cap", "sugar shaker cap", "shaker"),
        node("cake", "cake"),
        node("stand", "nightstand", attributes=("white",)),
    )
    about = SubtaskContext.of(Key.parse("POUR(sugar, cake)"), seen)
    assert (about.labels, about.parts, about.attributes) == (("shaker",), ("cap",), ("metal",))
    assert SubtaskContext.of(Key.parse("OPEN(nightstand drawer)"), seen).attributes == ("white",)
    assert SubtaskContext.of(Key.parse("PLAN(put the cake on the nightstand)"), seen).attributes == ("white",)
    assert SubtaskContext.of(Key.parse("OPEN(oven)"), seen) == SubtaskContext(holding=False, structures=(None,))


@pytest.mark.parametrize("ranking", ["key", "key-and-text"])
@pytest.mark.parametrize("back", [0.0, 3600.0])
def test_of_one_persons_remarks_the_later_one_counts_when_the_clock_stands_still_or_goes_back(
    ranking: str, back: float
) -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(ranking=ranking)) as book:
        say(book, "ann", 5000.0, "Pull the drawer open from the side.")
        say(book, "ann", 5000.0 - back, LATEST)
        found = book.retrieve(KEY).corrections
        assert found[0].text == LATEST and found[0].provenance.when > found[1].provenance.when


def test_between_books_time_decides_what_was_said_later() -> None:
    with Skillbook("sqlite://", FakeEmbedder()) as other, Skillbook("sqlite://", FakeEmbedder()) as book:
        say(other, "ann", 100.0, "Pull the drawer open from the side.")
        say(book, "ann", 5000.0, LATEST)
        exchange.merge(book, exchange.export(other), "another laboratory")
        assert book.retrieve(KEY).corrections[0].text == LATEST
