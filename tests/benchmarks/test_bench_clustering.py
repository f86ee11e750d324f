"""The book with planted contradictions: its labels hold, the measure can fail, the offline model does well on it."""

from __future__ import annotations

import json

import pytest
from cluster_books import clustering, new_book
from memo_benchmarks.planted_book import ASIDES, GENERAL, MATTERS, judge_book, plan_book, write_book
from memo_llm.offline.model import OfflineModel

from memo_core.policy.clustering import ClusteringSettings

APART = ClusteringSettings(join_keys=False)  # the fake embedder takes different things for one
FACTS = [fact for pair in MATTERS.values() for fact in pair] + list(ASIDES)


def clustered(answer) -> tuple:
    planted = plan_book(20, seed=5)
    with new_book() as book:
        write_book(book, planted)
        before = judge_book(book, planted)
        size = len(book.entries())
        outcomes = list(clustering(book, answer, APART).condense_all())
        return before, judge_book(book, planted), len(book.entries()) / size, outcomes


@pytest.mark.parametrize("fact", FACTS, ids=lambda fact: fact.name)
def test_a_facts_mark_is_in_all_its_phrases_and_in_no_other_facts(fact) -> None:
    assert all(fact.stated_in([text]) for text in (*fact.said, *fact.doc))
    others = [text for other in FACTS if other is not fact for text in (*other.said, *other.doc)]
    assert not [text for text in others if fact.stated_in([text])]


def test_general_statements_have_marks_of_their_own() -> None:
    for fact in GENERAL:
        assert all(fact.stated_in([text]) for text in fact.said)
        assert not any(fact.stated_in(other.said) for other in GENERAL if other is not fact)


def test_what_is_denied_is_not_stated() -> None:
    arc, straight = MATTERS["path"]
    assert arc.stated_in(["Lead it along an arc, not straight."])
    assert not straight.stated_in(["Lead it along an arc, not straight."])


def test_a_book_is_the_same_for_the_same_seed() -> None:
    assert plan_book(10, 3) == plan_book(10, 3) != plan_book(10, 4)


def numbers(request) -> range:
    notes = request.messages[-1].text.split("## Notes")[1].split("## Templates")[0]
    return range(1, len(notes.strip().splitlines()) + 1)


def test_a_model_that_keeps_everything_removes_no_contradiction() -> None:
    def keep(request) -> str:
        lines = request.messages[-1].text.split("## Notes")[1].split("## Templates")[0].strip().splitlines()
        return json.dumps({"entries": [{"text": t.split(". ", 1)[1], "from": [n]} for n, t in enumerate(lines, 1)]})

    before, after, _, _ = clustered([keep] * 40)
    assert before == after and after.gone_share == 0 and after.kept_share == 1 and after.missed


def test_a_model_that_drops_what_it_may_loses_the_rest() -> None:
    def drop(request) -> str:
        return json.dumps({"entries": [], "dropped": [{"number": n, "template": 1} for n in numbers(request)]})

    _, after, _, _ = clustered([drop] * 90)
    assert after.gone_share == 1 and after.kept_share < 0.5


def test_the_offline_model_removes_contradictions_and_repetitions_and_keeps_the_rest() -> None:
    model = OfflineModel()
    model.open()
    before, after, share, outcomes = clustered(model)
    assert before.gone_share == 0 and before.contradictions > 30 and before.repetitions > 30
    assert after.gone_share >= 0.9, after.missed
    assert after.kept_share >= 0.95, after.missed
    assert after.repetitions_left < after.repetitions / 2 and share < 0.7
    assert not [one.problem for one in outcomes if one.problem]
