"""``skillbook.cluster: after-run``: a run ends with condensing what it learnt; what goes wrong is only reported."""

from __future__ import annotations

import json

import pytest

from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument
from memo_core.events import ClusterDone, Problem
from memo_core.interfaces.llm import LanguageModelError
from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.prompt_files import Prompts
from memo_core.plugins.registry import Registry
from memo_core.policy.consolidation import ClusteringSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.runs.consolidation import AfterRun, after_run
from memo_core.runs.sections import SECTIONS
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import new_book, teach, texts

BOTH = json.dumps({"entries": [{"text": "Swing it.", "from": [1, 2]}], "dropped": []})


def of(*overrides: str):
    return after_run(load_experiment(Registry(), None, overrides, SECTIONS))


def test_a_run_clusters_only_where_the_config_says_so() -> None:
    assert of() is None
    assert of("skillbook.cluster=after-run", "skillbook.read_only=true") is None
    assert isinstance(of("skillbook.cluster=after-run", "clustering.llm=offline"), AfterRun)
    with pytest.raises(InvalidArgument, match="'memo-c' does not cluster"):
        of("skillbook.cluster=after-run", "method=memo-c")


def condensed(line) -> tuple[list[str], list]:
    heard: list = []
    with new_book() as book:
        teach(book, "OPEN(oven)", "Swing it.", "Do swing it.")
        model = ScriptedModel({"cluster": [line] * 3})
        calls = ModelCalls(model, StopSwitch(), RunLog(), heard.append, Budget(), Retrying(0))
        AfterRun(ClusteringSettings(), Prompts()).condense(book, calls, heard.append, 7)
        assert {request.seed for request in model.asked} == {7}, "not the run's seed"
        return texts(book), heard


def test_what_was_learnt_is_condensed_with_the_runs_model() -> None:
    left, heard = condensed(BOTH)
    assert left == ["Swing it."] and [e.key for e in heard if isinstance(e, ClusterDone)] == ["OPEN(oven)"]


@pytest.mark.parametrize("line", ["no idea", LanguageModelError("x", "is gone")])
def test_what_cannot_be_condensed_is_reported_and_stays(line) -> None:
    left, heard = condensed(line)
    assert len(left) == 2 and any(isinstance(event, Problem) for event in heard)
