"""A method's book is made anew from the raw log: the same log makes the same book, asking a model no second time."""

from __future__ import annotations

import json
from pathlib import Path

import attrs
import pytest

from memo_core.interfaces.llm import LanguageModel, Request
from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.prompt_files import Prompts
from memo_core.maintenance.rebuilding import AnswersOfBook, Rebuilding, Rebuilt
from memo_core.policy.consolidation import Clustering
from memo_core.policy.feedback_processing import FeedbackProcessor, asking_without_a_run
from memo_core.policy.methods import METHODS
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.skillbook import consolidating, exchange, raw_log
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import GLOBAL_KEY, Note, Reaction
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.sharing.rebuild_input import RawLog
from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import approve, new_book
from tests.support.loop_setup import NOTES

DOOR, CUP = Key.parse("OPEN(door)"), Key.parse("PICK_UP(cup)")
ARC, HINGE = "Lead it along an arc.", "Doors turn about a hinge."


def merged(request: Request) -> str:
    """A model that merges the two notes on the door and leaves everything else."""
    text = request.messages[-1].text
    if ARC in text:
        return json.dumps({"entries": [{"text": ARC, "from": [1, 2]}], "dropped": []})
    note = HINGE if HINGE in text else json.loads(NOTES)["corrections"][0]
    return json.dumps({"entries": [{"text": note, "from": [1]}], "dropped": []})


def taught(book: Skillbook) -> None:
    """A book with read-backs, a template, clustering, an alias, and words that nothing was made of yet."""
    first = book.record_feedback("an arc!", "ana", subtask="OPEN(door)", when=10.0, code="pull()", scene="kitchen")
    notes = [Note(DOOR, "Lead it along an arc."), Note(CUP, "Grip low."), Note(GLOBAL_KEY, "Doors turn.")]
    _, low, turn = book.add_notes(first, notes, "kitchen")
    with raw_log.clock(book, lambda: 11.0):
        book.read_back(first, [Reaction(low.id, "struck"), Reaction(turn.id, "reworded", "Doors turn about a hinge.")])
    second = book.record_feedback("along an arc", "ben", subtask="OPEN(door)", when=20.0)
    book.add_lessons(second, DOOR, ["Lead it along an arc, slowly."])
    approval = book.record_feedback("", "ana", subtask="OPEN(door)", kind="approval", when=30.0)
    book.add_template(approval, DOOR, "def arc(): ...", derived_from=[first])
    consolidating.add_alias(book, "OPEN(door)", "OPEN(oven door)")
    book.record_feedback("not that hard", "cleo", subtask="PICK_UP(cup)", when=40.0, kept_only="memo-s")


def calls_of(model: LanguageModel) -> ModelCalls:
    return ModelCalls(model, StopSwitch(), RunLog(), lambda event: None, Budget(), Retrying(0))


def rebuilt(
    source: Skillbook, method: str, llm: ScriptedModel, until: int | float | None = None, log: RawLog | None = None
) -> tuple[list, Rebuilt]:
    with new_book() as target:
        rebuilding = Rebuilding(log or raw_log.raw_log(source, until), target, METHODS[method], method)
        model = AnswersOfBook(llm, source)
        ask = asking_without_a_run(calls_of(model), Prompts(), FakeEnvironment().robot, 0)
        rebuilding.replay(model, FeedbackProcessor(ask, target, lambda event: None), lambda said: None)
        if METHODS[method].clusters:
            rebuilding.condense(Clustering(target, calls_of(model), model.name), model)
        return list(exchange.export(target)), rebuilding.result


def model() -> ScriptedModel:
    return ScriptedModel({"feedback": [NOTES], "cluster": [merged] * 4})


def texts(records: list) -> list[str]:
    return sorted(r["text"] for r in records if r["record"] == "entry" and r["superseded_by"] is None)


@pytest.mark.parametrize("method", list(METHODS))
def test_two_rebuilds_of_one_log_are_one_book_and_the_second_asks_nobody(tmp_path: Path, method: str) -> None:
    with new_book(str(tmp_path / "book.db")) as source:
        taught(source)
        first, one = rebuilt(source, method, model())
        second, two = rebuilt(source, method, ScriptedModel({}))
    assert first == second
    assert (two.asked, two.kept) == (0, one.asked)
    assert one.asked == (0 if method == "memo-s" else 1 + one.clusters) and (one.clusters > 1) == (method == "memo")
    assert len([r for r in first if r["record"] == "feedback" and r["kind"] != "edit"]) == 4


def test_each_method_gets_its_own_book_with_what_people_said_of_the_notes(tmp_path: Path) -> None:
    with new_book(str(tmp_path / "book.db")) as source:
        taught(source)
        books = {method: rebuilt(source, method, model())[0] for method in METHODS}
        live = texts(exchange.export(source))
    assert texts(books["memo-s"]) == []
    assert "Grip low." not in texts(books["memo-c"]) and "Doors turn about a hinge." in texts(books["memo-c"])
    assert texts(books["memo-c"]) == sorted([*live, "Move over the middle of the object before closing."])
    assert "def arc(): ..." not in texts(books["droc-v"]) and "def arc(): ..." in texts(books["memo"])
    assert "Lead it along an arc, slowly." not in texts(books["memo"]), "memo clusters"
    assert "Lead it along an arc, slowly." in texts(books["droc-v"])
    assert HINGE in texts(books["memo-c"]) and HINGE not in texts(books["droc-v"])  # it has no general statements
    keys = {(r["action"], *r["objects"]) for r in books["memo-c"] if r["record"] == "entry"}
    assert ("open", "door") in keys, "the key of when it was said"


def test_a_rebuild_goes_as_far_as_it_is_told(tmp_path: Path) -> None:
    with new_book(str(tmp_path / "book.db")) as source:
        taught(source)
        one, _ = rebuilt(source, "memo-c", model(), until=1)
        before_the_read_back, _ = rebuilt(source, "memo-c", model(), until=10.5)
        assert raw_log.raw_log(source, 1).feedback == raw_log.raw_log(source, 10.5).feedback
    assert texts(one) == ["Doors turn about a hinge.", "Lead it along an arc."]
    assert texts(before_the_read_back) == ["Doors turn.", "Grip low.", "Lead it along an arc."]


def test_what_was_struck_is_struck_from_notes_that_another_model_words_otherwise() -> None:
    other = json.dumps({"corrections": ["Hold the cup low and really tight."], "general": ["Be careful."]})
    with new_book() as source:
        said = source.record_feedback("hold it low and tight", "ana", subtask="PICK_UP(cup)", kept_only="x", when=1.0)
        low = source.add_notes(said, [Note(CUP, "Hold the cup low and tight.")])[0]
        source.read_back(said, [Reaction(low.id, "struck")])
        nothing_made = attrs.evolve(raw_log.raw_log(source), entries={})
        records, result = rebuilt(source, "memo-c", ScriptedModel({"feedback": [other]}), log=nothing_made)
    assert texts(records) == ["Be careful."] and (result.read_backs, result.unmatched) == (1, 0)


def test_forgetting_somebody_forgets_the_answers_to_questions_about_their_words(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    answer = json.dumps({"corrections": ["zebra grip"], "general": []})
    with new_book(str(path)) as source:
        taught(source)
        rebuilt(source, "memo-c", ScriptedModel({"feedback": [answer]}))
        assert b"zebra" in b"".join(file.read_bytes() for file in tmp_path.iterdir())
        source.forget("cleo")
        again, result = rebuilt(source, "memo-c", ScriptedModel({}))
        assert "zebra" not in json.dumps(again) and result.kept == 0
    assert b"zebra" not in b"".join(file.read_bytes() for file in tmp_path.iterdir())


def test_a_template_that_an_approval_confirmed_is_there_again() -> None:
    with new_book() as source:
        approve(source, "OPEN(door)", "def arc(): ...")
        approve(source, "OPEN(door)", "def arc(): ...  # the same", who="ben")
        records, result = rebuilt(source, "memo-c", ScriptedModel({}))
    assert texts(records) == ["def arc(): ..."] and result.asked == 0
    [template] = [r for r in records if r["record"] == "entry"]
    assert len(template["sources"]) == 2
