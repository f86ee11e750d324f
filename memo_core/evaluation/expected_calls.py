"""Count the runs that an experiment file asks for, and estimate their questions to a language model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import attrs

from memo_core.config import Experiment
from memo_core.config.errors import DEFAULT
from memo_core.evaluation.grid import trials_of
from memo_core.interfaces.llm import Usage
from memo_core.policy.settings import RunSettings
from memo_core.study.history import training_tasks

SUBTASKS, REPAIRS, CORRECTIONS = 3, 1, 1  # of a typical run
ASSUMPTION = (
    "typical: {} subtasks, {} repair and, where somebody teaches, {} correction a run; upper: every run reaches "
    "run.subtasks ({}), run.attempts ({}) and run.repairs ({}); both: prompts and answers as long as the examples', no "
    "question asked again, no clustering"
)


@attrs.frozen
class Planned:
    """``runs`` of one kind, with the questions of each phase that one of them needs."""

    kind: str
    runs: int
    typical: Mapping[str, int]
    upper: Mapping[str, int]


@attrs.frozen
class Price:
    """Questions, tokens (asked and answered) and cost (US dollars; None: unknown) of all runs of one kind."""

    questions: int
    tokens: int
    cost: float | None


def planned_runs(experiment: Experiment) -> tuple[Planned, ...]:
    """The runs of the study and of the evaluation that a file describes; of a file with neither, one run. Raises
    ``InvalidArgument``, ``UnknownName``."""
    given = {value.path.partition(".")[0] for value in experiment.values if value.origin != DEFAULT}
    found = [*_of_study(experiment, "study" in given), *_of_evaluation(experiment, "evaluation" in given)]
    return tuple(found) or (_planned("run (of one seed)", 1, experiment, None),)


def assumption(run: RunSettings) -> str:
    """The meaning of the typical and the upper figure, in one line."""
    return ASSUMPTION.format(SUBTASKS, REPAIRS, CORRECTIONS, run.subtasks, run.attempts, run.repairs)


def price_of(calls: Mapping[str, int], usages: Mapping[str, Usage], runs: int) -> Price:
    """The price of ``runs`` runs if each question costs what the one of its phase in ``usages`` did."""
    used = [(runs * number, usages[phase]) for phase, number in calls.items()]
    tokens = sum(n * (usage.prompt_tokens + usage.completion_tokens) for n, usage in used)
    costs = [n * usage.cost for n, usage in used if usage.cost is not None]
    return Price(sum(n for n, _ in used), tokens, sum(costs) if len(costs) == len(used) else None)


def _of_study(experiment: Experiment, given: bool) -> Iterator[Planned]:
    if given:
        settings = experiment.section("study")
        runs = settings.histories * settings.rounds * len(training_tasks(experiment, settings))
        yield _planned("study", runs, experiment, None)


def _of_evaluation(experiment: Experiment, given: bool) -> Iterator[Planned]:
    trials = trials_of(experiment, experiment.section("study").histories) if given else ()
    most = experiment.section("evaluation").corrected.corrections
    for mode, corrections in (("zero-shot", 0), ("corrected", most)):
        if runs := sum(trial.mode == mode for trial in trials):
            yield _planned(f"evaluation, {mode}", runs, experiment, corrections)


def _planned(kind: str, runs: int, experiment: Experiment, corrections: int | None) -> Planned:
    """``corrections``: the most in a run, beside ``run.max_feedback``; None: no limit, 0: nobody teaches."""
    run: RunSettings = experiment.section("run")
    limits = (corrections, run.max_feedback, run.subtasks * run.attempts)
    most = min(limit for limit in limits if limit is not None)
    again = min(most, run.subtasks * (run.attempts - 1))  # a subtask's last correction is followed by nothing
    programs = (run.subtasks + again) * (1 + run.repairs)
    upper = _calls(run.subtasks, programs, most, again, most != 0)
    few, subtasks = min(CORRECTIONS, most), min(SUBTASKS, run.subtasks)
    typical = _calls(subtasks, subtasks + min(few, again) + min(REPAIRS, run.repairs), few, min(few, again), most != 0)
    upper["merge"] = upper["template"] if experiment.section("teaching").merge else 0
    return Planned(kind, runs, typical, upper)


def _calls(subtasks: int, programs: int, corrections: int, again: int, taught: bool) -> dict[str, int]:
    """Each subtask is planned, and DONE after them; ``again``: the corrections after which the next is planned anew."""
    plans, templates = subtasks + 1 + again, subtasks * taught
    return {"plan": plans, "code": programs, "feedback": corrections, "template": templates}
