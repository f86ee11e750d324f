"""Clustering a book with an experiment's settings: once, after a run, or continuously beside a running robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument, MemoError, Stopped
from memo_core.events import Event, ModelCalled, Problem
from memo_core.interfaces.llm import LanguageModel, LanguageModelError, Usage
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.spending import Spent
from memo_core.policy.consolidation import Clustering, ClusteringSettings, ClusterOutcome
from memo_core.policy.generalising import Generalising, GroupOutcome, Tester
from memo_core.process.freed_memory import give_back_freed_memory
from memo_core.process.signal_safe import Wake
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.runs.factories import budget_of, library_of, prompts_of, sandbox_of
from memo_core.runs.folder import RunFolder
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.grouping import entries_of
from memo_core.skillbook.functions import Consolidated
from memo_core.skillbook.model.entries import key_label
from memo_core.skillbook.writing.functions import GroupChange
from memo_core.skillbook.writing.key_aliases import NearKeys

LATE_CALLS_S = 2.0


@attrs.define
class Spending:
    """Spending on models, and the words they did not understand, summed from events."""

    spent: Spent = Spent()
    not_understood: list[str] = attrs.field(factory=list)

    def note(self, event: Event) -> None:
        if not isinstance(event, ModelCalled):
            return
        usage = Usage(event.prompt_tokens, event.completion_tokens, event.cost, event.latency_s, event.cached_tokens)
        self.spent = self.spent.plus(usage)
        self.not_understood += event.not_understood

    def record(self) -> dict[str, Any]:
        """As ``--json`` prints it."""
        spent = self.spent
        return {
            "calls": spent.calls,
            "prompt_tokens": spent.prompt_tokens,
            "cached_tokens": spent.cached_tokens,
            "completion_tokens": spent.completion_tokens,
            "cost": spent.known_cost,
        }


def check_method(experiment: Experiment) -> None:
    """Raises ``InvalidArgument`` for a method that does not cluster."""
    method = experiment.choice("method").backend
    if not method.memory.clusters:
        raise InvalidArgument(
            "method", f"{method.name!r} does not cluster", "a method that does, such as --set method=memo"
        )


@contextmanager
def calls_without_a_run(
    experiment: Experiment,
    llm: LanguageModel,
    emit: Callable[[Event], None],
    stop: StopSwitch,
    what: str,
    keep: Path | None = None,
    on_text: Callable[[str, str], None] | None = None,
) -> Iterator[ModelCalls]:
    """Model calls of a command that is not a run: ``llm``, opened here, within the limits of the ``run`` section;
    ``what`` names the command in a study's ledger. ``keep``: a new folder for questions and answers; ``on_text`` as for
    ``ModelCalls``. Raises ``MemoError`` if something cannot be opened."""
    folder = RunFolder(keep, option="--keep") if keep is not None else None
    log = RunLog(keep)
    run = experiment.section("run")
    budget = budget_of(run, what)

    def emitted(event: Event) -> None:
        if folder is not None:
            folder.event(event)
        emit(event)

    llm.open()
    try:
        budget.open(llm)
        log.begin({"run": what}, {})
        yield ModelCalls(llm, stop, log, emitted, budget, Retrying(run.retries, run.retry_wait_s), on_text)
    finally:
        budget.wait(LATE_CALLS_S)
        budget.close()
        llm.close()
        log.close()
        if folder is not None:
            folder.close()
        give_back_freed_memory()


@contextmanager
def clustering_of(
    experiment: Experiment,
    book: Skillbook,
    emit: Callable[[Event], None],
    stop: StopSwitch,
    keep: Path | None = None,
    tester: Tester | None = None,
) -> Iterator[Clustering]:
    """The clustering of an open book. ``tester`` runs the calls of new functions; without one they are not tested.
    Raises as ``calls_without_a_run``."""
    settings: ClusteringSettings = experiment.section("clustering")
    choice = settings.llm if settings.llm is not None else experiment.choice("llm")
    llm: LanguageModel = choice.create()
    with calls_without_a_run(experiment, llm, emit, stop, "cluster", keep) as calls, ExitStack() as opened:
        skills, prompts = library_of(experiment), prompts_of(experiment)
        generalising = None
        if llm.calls_functions:
            robot, sandbox = experiment.create("robot"), sandbox_of(experiment)
            opened.callback(sandbox.close)
            more = (settings.reasks, experiment.seed, sandbox.check)
            generalising = Generalising(book, calls, prompts, robot, skills, sandbox.subset(), tester, *more)
        yield Clustering(book, calls, calls.model, settings, prompts, emit, experiment.seed, generalising, skills)


@attrs.frozen(eq=False)
class AfterRun:
    """Clustering as the end of a run (``skillbook.cluster: after-run``)."""

    settings: ClusteringSettings
    prompts: Prompts
    names: frozenset[str] = frozenset()  # of the robot's functions

    def condense(self, book: Skillbook, calls: ModelCalls, emit: Callable[[Event], None], seed: int) -> None:
        """Condense what changed, and make functions where no model need be asked (``memo cluster`` does the rest).

        With the run's seed and budget, and with its model unless the settings name another. What a model cannot answer
        is reported, for the run itself has ended before. Raises ``Stopped``.
        """
        own: LanguageModel | None = self.settings.llm.create() if self.settings.llm is not None else None
        try:
            if own is not None:
                own.open()
                calls = calls.to(own)
            clustering = Clustering(book, calls, calls.model, self.settings, self.prompts, emit, seed, names=self.names)
            for outcome in clustering.condense_all():
                if isinstance(outcome, ClusterOutcome) and outcome.problem:
                    emit(Problem(f"cluster {outcome.cluster.label}", f"stays as it was: {outcome.problem}"))
        except Stopped:
            raise
        except MemoError as error:
            emit(Problem("clustering", f"{error}; memo cluster goes on with it"))
        finally:
            if own is not None:
                own.close()


def after_run(experiment: Experiment) -> AfterRun | None:
    """The clustering that the experiment wants after a run; None for none. Raises as ``check_method``."""
    if experiment.section("skillbook").cluster != "after-run" or experiment.section("skillbook").read_only:
        return None
    check_method(experiment)
    return AfterRun(experiment.section("clustering"), prompts_of(experiment), frozenset(library_of(experiment)))


def in_background(experiment: Experiment, url: str | None = None) -> bool:
    """Whether the book is clustered while the robot works (``skillbook.cluster: background``).

    Args:
        experiment: the experiment.
        url: the book; None: the experiment's.

    Returns:
        Whether the experiment wants it.

    Raises:
        InvalidArgument: if it wants it, and the robot is real, the book is in memory or may not be written, or the
            method does not cluster.
    """
    settings = experiment.section("skillbook")
    if settings.cluster != "background":
        return False
    if not experiment.create("robot_driver").simulated:
        name = experiment.choice("robot_driver").backend.name
        problem = f"background beside the real robot of driver {name!r}"
        raise InvalidArgument("skillbook.cluster", problem, "after-run, or memo cluster when the robot is at rest")
    if settings.read_only:
        raise InvalidArgument("skillbook.cluster", "background, and skillbook.read_only is true", "off")
    if Skillbook(url or settings.url).database.in_memory:
        raise InvalidArgument("skillbook.cluster", "background, and the skillbook is in memory", "after-run, or a file")
    check_method(experiment)
    return True


def watch(
    book: Skillbook, clustering: Clustering, stop: StopSwitch, interval_s: float, report: Callable[[Any], None]
) -> None:
    """Condense clusters as they change, until ``stop`` is pressed. ``report`` receives each ``NearKeys`` that is
    merged, each ``ClusterOutcome``, and each error after which it continues. A cluster for which the model gave no
    usable answer is not asked about again until it changes. Raises ``Stopped``, and errors that make continuing
    pointless: ``BudgetExceeded``, a deleted book."""
    tried: set[tuple[Any, ...]] = set()
    seen = -1
    while True:
        generation = book.generation()
        if generation != seen:
            seen = generation if _round(clustering, tried, report) else -1
        _pause(stop, interval_s if seen >= 0 else max(interval_s, 10.0))


def _round(clustering: Clustering, tried: set[tuple[Any, ...]], report: Callable[[Any], None]) -> bool:
    """Whether everything that could be done was done."""
    near: NearKeys
    for near in clustering.near_keys():
        clustering.join(near)
        report(near)
    done = True
    for cluster in clustering.clusters():
        state = (cluster.label, cluster.state)
        if state in tried:
            continue
        try:
            outcome = clustering.condense(cluster)
        except LanguageModelError as error:
            report(error)
            return False
        if outcome.status == "left":
            tried.add(state)
        done = done and outcome.status != "changed"
        report(outcome)
    try:
        for made in clustering.consolidate_groups(skip=tried):
            if isinstance(made, GroupOutcome) and made.status == "left":
                tried.add(entries_of(made.group))
            report(made)
    except LanguageModelError as error:
        report(error)
        return False
    return done


def _pause(stop: StopSwitch, seconds: float) -> None:
    news = Wake()
    with stop.waking(news.set):
        news.wait(seconds)
    stop.check("waiting for changes")


def group_record(outcome: Consolidated | GroupOutcome) -> dict[str, Any]:
    """A consolidation of several keys as JSON values, with entries by their ids in the book."""
    group = outcome if isinstance(outcome, GroupOutcome) else None
    made = group.made if group is not None else outcome if isinstance(outcome, Consolidated) else None
    change = made.change if made is not None else GroupChange()
    record: dict[str, Any] = {
        "keys": sorted({key_label(entry.key) for entry in made.members}) if made else [],
        "status": group.status if group is not None else "generalised",
        "revision": made.revision if made else None,
        "functions": [
            {"name": one.name, "code": one.code, "calls": [{"entry": entry, "call": call} for entry, call in one.calls]}
            for one in change.functions
        ],
        "replaced": list(change.replaced),
        "notes": [{"text": note.text, "from": list(note.of)} for note in change.notes],
        "inside": [{"entry": note, "function": change.functions[index].name} for note, index in change.inside],
        "entries_before": made.entries_before if made else 0,
        "entries_after": made.entries_after if made else 0,
        "characters_before": made.characters_before if made else 0,
        "characters_after": made.characters_after if made else 0,
    }
    if group is not None:
        record |= {
            "keys": sorted({key_label(member.key) for member in group.group.members}),
            "left": [{"entry": entry, "reason": why} for entry, why in group.left.items()],
            "tested": [
                {"entry": entry, "start": start, "success": success, "reason": why}
                for entry, starts in group.tested.items()
                for start, success, why in starts
            ],
            "untested": group.untested or None,
            "problem": group.problem or None,
            "calls": group.calls,
        }
    return record


def outcome_record(outcome: ClusterOutcome) -> dict[str, Any]:
    """An outcome as JSON values, with entries by their ids in the book."""
    cluster, proposal = outcome.cluster, outcome.proposal
    ids = {number: member.id for number, member in enumerate(cluster.members, start=1)}
    texts = {number: member.text for number, member in enumerate(cluster.members, start=1)}
    return {
        "key": cluster.label,
        "status": outcome.status,
        "revision": outcome.committed.revision if outcome.committed else None,
        "entries_before": outcome.entries_before,
        "entries_after": outcome.entries_after,
        "characters_before": outcome.characters_before,
        "characters_after": outcome.characters_after,
        "templates": [template.entry.id for template in cluster.templates],
        "templates_left_out": cluster.left_out,
        "entries": [
            {"text": one.text, "from": [ids[number] for number in one.of]}
            for one in (proposal.entries if proposal else ())
        ],
        "dropped": [
            {
                "entry": ids[gone.number],
                "text": texts[gone.number],
                "template": cluster.templates[gone.template - 1].entry.id,
                "reason": gone.why,
            }
            for gone in (proposal.dropped if proposal else ())
        ],
        "problem": outcome.problem or None,
        "calls": outcome.calls,
    }
