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
from memo_core.skillbook.functions import consolidated_groups
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import approve, new_book, teach, texts
from tests.support.generalising_books import active

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


# -- programs of several keys ------------------------------------------------------------------------------------------

PROGRAM = '''\
def open_{0}(name="{0} door", angle={1}):
    """Open a door."""
    turn_about(name, angle)
    look()
'''


def after_a_run(book, model, names: frozenset[str] = frozenset(), settings: ClusteringSettings | None = None) -> list:
    heard: list = []
    calls = ModelCalls(model, StopSwitch(), RunLog(), heard.append, Budget(), Retrying(0))
    AfterRun(settings or ClusteringSettings(), Prompts(), names).condense(book, calls, heard.append, 7)
    return heard


def teach_doors(book) -> None:
    for name, angle in (("microwave", 80), ("oven", 85)):
        approve(book, f"OPEN({name})", PROGRAM.format(name, angle))


def test_programs_that_differ_in_defaults_are_merged_without_asking_a_model() -> None:
    with new_book() as book:
        teach_doors(book)
        model = ScriptedModel({})
        heard = after_a_run(book, model)
        assert active(book, "call") == {
            "OPEN(microwave)": "open_oven('microwave door', angle=80)",
            "OPEN(oven)": "open_oven('oven door')",
        }
        assert not book.entries("template") and not model.asked
        [done] = [event for event in heard if isinstance(event, ClusterDone)]
        assert (done.key, done.entries_before, done.entries_after) == ("OPEN(microwave), OPEN(oven)", 2, 3)
        assert not [event for event in heard if isinstance(event, Problem)]
        before = book.entries()
        after_a_run(book, model)
        assert book.entries() == before, "the next run finds nothing to do"


def test_a_program_that_is_approved_later_joins_the_function_after_its_run() -> None:
    with new_book() as book:
        teach_doors(book)
        after_a_run(book, ScriptedModel({}))
        approve(book, "OPEN(cabinet)", PROGRAM.format("cabinet", 85))
        after_a_run(book, ScriptedModel({}))
        assert active(book, "call")["OPEN(cabinet)"] == "open_oven('cabinet door')"
        assert len(book.entries("call")) == 3 and len(book.entries("function")) == 1 and not book.problems()


def test_no_function_gets_the_name_of_one_of_the_robots() -> None:
    with new_book() as book:
        for name, angle in (("microwave", 80), ("oven", 85)):
            approve(book, f"OPEN({name})", PROGRAM.format(name, angle).replace(f"open_{name}", "pull"))
        after_a_run(book, ScriptedModel({}), frozenset({"pull"}))
        assert set(active(book, "call").values()) == {"pull_2('microwave door', angle=80)", "pull_2('oven door')"}


def test_no_function_gets_the_name_of_one_of_pythons() -> None:
    with new_book() as book:
        for name, angle in (("microwave", 80), ("oven", 85)):
            approve(book, f"OPEN({name})", PROGRAM.format(name, angle).replace(f"open_{name}", "open"))
        after_a_run(book, ScriptedModel({}))
        assert set(active(book, "call").values()) == {"open_2('microwave door', angle=80)", "open_2('oven door')"}


def test_an_experiments_after_run_knows_the_names_of_the_robots_functions() -> None:
    made = of("skillbook.cluster=after-run", "clustering.llm=offline")
    assert made is not None and {"look", "move_to"} <= made.names


def test_programs_that_need_a_model_wait_for_memo_cluster() -> None:
    with new_book() as book:
        approve(book, "OPEN(microwave)", PROGRAM.format("microwave", 80))
        approve(book, "OPEN(oven)", PROGRAM.format("oven", 85).replace("look()", "pass"))
        before, model = book.entries(), ScriptedModel({"generalise": ["no idea"]})
        after_a_run(book, model)
        assert book.entries() == before and not model.asked
        assert len(consolidated_groups(book)) == 1, "they were not considered"


def test_switched_off_after_a_run_programs_stay_as_they_are() -> None:
    with new_book() as book:
        teach_doors(book)
        before = book.entries()
        after_a_run(book, ScriptedModel({}), settings=ClusteringSettings(groups=False))
        assert book.entries() == before
