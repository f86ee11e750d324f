"""Whatever a model answers: clustering never grows a cluster, never loses an entry, never breaks a book."""

from __future__ import annotations

import json

import pytest
import sqlalchemy as sa
from hypothesis import HealthCheck, given, settings, strategies as st

from memo_core.llm.readers.condensed import read_condensed
from memo_core.llm.readers.unreadable import Unreadable
from memo_core.skillbook import consolidating, history
from memo_core.skillbook.consolidation.rules import Condensed, Dropped, Merged, problem_with
from tests.support.cluster_books import approve, clustering, new_book, only_cluster, teach, texts

WORDS = [
    "pull",
    "the",
    "handle",
    "out",
    "along",
    "an",
    "arc",
    "3",
    "cm",
    "12",
    "degrees",
    "not",
    "gently",
    "hold",
    "rim",
]
PHRASE = st.lists(st.sampled_from(WORDS), min_size=1, max_size=6).map(" ".join)
NUMBER = st.one_of(st.integers(-1, 8), st.sampled_from(["1", "x", "²", "9" * 5000, None, 1.0, 2.5, True]))
ENTRY = st.fixed_dictionaries(
    {}, optional={"text": st.one_of(PHRASE, st.just(""), st.none()), "from": st.one_of(st.lists(NUMBER), NUMBER)}
)
DROPPED = st.fixed_dictionaries(
    {}, optional={"number": NUMBER, "template": NUMBER, "reason": st.one_of(PHRASE, NUMBER)}
)
LISTS = {"entries": st.lists(st.one_of(ENTRY, st.none())), "dropped": st.one_of(st.lists(DROPPED), NUMBER)}
WILD = st.one_of(st.text(), st.fixed_dictionaries({}, optional=LISTS).map(json.dumps))


@st.composite
def plausible(draw: st.DrawFn, members: list[str], templates: int) -> str:
    """An answer of the right form: numbers dealt out to entries and to what is dropped, texts right, short or wrong."""
    groups: dict[int, list[int]] = {}
    dropped = []
    for number in range(1, len(members) + 1):
        fate = draw(st.integers(0, len(members) + 1))
        if fate == 0 and draw(st.booleans()):
            continue
        if fate <= 1:
            dropped.append({"number": number, "template": draw(st.integers(0, templates + 1)), "reason": "so"})
        if fate != 1:
            groups.setdefault(fate, []).append(number)
    entries = []
    for numbers in groups.values():
        words = " ".join(dict.fromkeys(" ".join(members[n - 1] for n in numbers).split()))
        text = draw(st.sampled_from([members[numbers[0] - 1], words, members[numbers[-1] - 1], words[:5], words * 2]))
        entries.append({"text": text, "from": numbers})
    return "Here you are:\n```json\n" + json.dumps({"entries": entries, "dropped": dropped}) + "\n```"


def state(book) -> dict[int, str]:
    return {entry.id: entry.text for entry in book.entries()}


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_no_answer_grows_a_cluster_loses_an_entry_or_breaks_a_book(data: st.DataObject) -> None:
    members = data.draw(st.lists(PHRASE, min_size=1, max_size=6))
    templates = data.draw(st.integers(0, 2))
    with new_book() as book:
        for number, text in enumerate(members):
            teach(book, "OPEN(oven)", text, who=("ana", "ben")[number % 2])
        for number in range(templates):
            approve(book, ("OPEN(oven)", "OPEN(oven door)")[number], who="cleo")
        before, original = book.entries(), state(book)
        shown = only_cluster(book).members if consolidating.clusters(book) else ()
        answer = st.one_of(WILD, plausible([m.text for m in shown] or ["x"], templates))
        answers = data.draw(st.lists(answer, min_size=3, max_size=3))

        outcomes = list(clustering(book, answers).condense_all())

        after = [entry for entry in book.entries() if entry.kind != "template"]
        assert len(after) <= len(members)
        assert sum(len(entry.text) for entry in after) <= sum(map(len, members))
        for outcome in outcomes:
            assert outcome.entries_after <= outcome.entries_before
        assert _accounted_for(book, before)
        assert book.retrieve("OPEN(oven)").generation == book.generation()
        _check_whole(book)

        for revision in reversed(
            [one.id for one in history.revisions(book) if one.id > max(e.revision for e in before)]
        ):
            history.roll_back(book, revision)
        assert state(book) == original, "what was superseded can be restored"

        book.forget("ana")
        _check_whole(book)
        assert {source.who for entry in book.entries() for source in _said(book, entry.id)} <= {"ben", "cleo"}


def _said(book, entry: int) -> list:
    return [book.feedback(source) for source in book.sources([entry])]


def _accounted_for(book, before: list) -> bool:
    """Every member is valid, or in one that is and has its sources, or gave way to a template, which says so."""
    valid = {entry.id: set(book.sources([entry.id])) for entry in book.entries()}
    gave_way = {
        change.entry.id: change
        for revision in history.revisions(book)
        for change in revision.changes
        if change.change == "superseded"
    }
    for entry in before:
        if entry.id in valid:
            continue
        change = gave_way[entry.id]
        at = entry
        while at.id not in valid and at.id in gave_way and book.entry(gave_way[at.id].because).kind != "template":
            at = book.entry(gave_way[at.id].because)
        merged = at.id in valid and set(book.sources([entry.id])) <= valid[at.id]
        dropped = at.id in gave_way and book.entry(gave_way[at.id].because).kind == "template"
        if not (change.why and (merged or dropped)):
            return False
    return True


def _check_whole(book) -> None:
    with book.database.read() as connection:
        assert connection.execute(sa.text("PRAGMA integrity_check")).scalar() == "ok"
        assert connection.execute(sa.text("PRAGMA foreign_key_check")).all() == []


# -- each rule by itself ---------------------------------------------------------------------------------------------


@pytest.fixture
def cluster():
    with new_book() as book:
        teach(
            book, "OPEN(oven)", "Pull it 3 cm straight out.", "Lead the handle along an arc.", "Hold the rim, gently."
        )
        approve(book, "OPEN(oven)")
        yield only_cluster(book)


RULES = {
    "names number 4": [Merged("Pull it 3 cm straight out.", (1, 4))],
    "stands twice": [Merged("Pull it 3 cm.", (1,)), Merged("Pull it 3 cm.", (1,))],
    "neither in an entry's": [Merged("Pull it 3 cm straight out.", (1,))],
    "derives from no number": [Merged("Be careful.", ())],
    "has no text": [Merged(" ", (1, 2, 3))],
    "no word in common": [Merged("xyz 3", (1, 2, 3))],
    "loses the amount 3 of number 1": [Merged("Pull the handle along an arc, hold the rim gently.", (1, 2, 3))],
    "more than": [Merged("Pull it 3 cm straight out. " * 9, (1, 2, 3))],
}


@pytest.mark.parametrize("said", RULES)
def test_an_answer_that_breaks_a_rule_is_refused_with_the_reason(cluster, said: str) -> None:
    assert said in problem_with(cluster, Condensed(tuple(RULES[said])))


KEPT = (Merged("Lead the handle along an arc.", (2,)), Merged("Hold the rim, gently.", (3,)))


@pytest.mark.parametrize(
    ("dropped", "entries", "said"),
    [
        ((Dropped(1, 1),), KEPT, ""),
        ((Dropped(1, 2),), KEPT, "there are templates 1 to 1"),
        ((Dropped(1, 1), Dropped(1, 1)), KEPT, "stands twice"),
        ((Dropped(1, 1),), (*KEPT, Merged("Pull it.", (1,))), ""),  # a part of it goes, with its amount
        ((Dropped(1, 1),), (*KEPT, Merged("Pull it 3 cm straight out.", (1,))), "is the whole of it"),
    ],
)
def test_only_what_contradicts_a_shown_template_is_dropped(cluster, dropped, entries, said: str) -> None:
    problem = problem_with(cluster, Condensed(entries, dropped))
    assert said in problem and bool(said) == bool(problem)


def test_without_templates_nothing_is_dropped() -> None:
    with new_book() as book:
        teach(book, "OPEN(oven)", "Pull it.", "Push it.")
        proposal = Condensed((Merged("Pull it.", (1,)),), (Dropped(2, 1),))
        assert "no templates" in problem_with(only_cluster(book), proposal)


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ("I would keep them all.", "no JSON object"),
        ('{"entries": "all"}', '"entries" must be a list'),
        ('{"entries": [{"from": [1]}], "dropped": []}', 'no "text"'),
        ('{"entries": [{"text": "Pull it", "from": ["one"]}]}', "not a whole number"),
        ('{"entries": [], "dropped": [{"number": null, "template": 1}]}', "not a whole number"),
        (json.dumps({"entries": [{"text": "Pull " * 200, "from": [1, 2, 3]}]}), "characters; at most"),
    ],
)
def test_an_answer_that_cannot_be_read_says_what_was_wrong(cluster, answer: str, said: str) -> None:
    with pytest.raises(Unreadable, match=said):
        read_condensed(answer, cluster)


def test_an_answer_around_which_a_model_talks_is_read(cluster) -> None:
    answer = """Sure! {'entries': [{'text': 'Lead the handle  along an arc.', 'from': '2'},
    {"text": "Hold the rim, gently.", "from": [3, 3.0]}], "dropped": [{"number": "1", "reason": "the door swings"}],}"""
    proposal = read_condensed(answer, cluster)
    assert proposal.dropped == (Dropped(1, 1, "the door swings"),)
    assert [one.of for one in proposal.entries] == [(2,), (3,)]


def test_texts_are_what_the_book_holds(cluster) -> None:
    with new_book() as book:
        teach(book, "OPEN(oven)", "One.", "Two.")
        assert texts(book) == ["One.", "Two."]


def test_notes_without_a_word_are_joined_too() -> None:
    with new_book() as book:
        teach(book, "OPEN(oven)", "3", "3")
        assert [one.text for one in consolidating.join_duplicates(book, only_cluster(book)).members] == ["3"]
