"""Rebuilding a book with an experiment's settings (``memo skillbook rebuild``)."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.events import Event
from memo_core.interfaces.backend import Memory
from memo_core.interfaces.llm import LanguageModelError
from memo_core.llm.readers import Unreadable, read_template
from memo_core.maintenance.rebuilding import AnswersOfBook, Rebuilding, Rebuilt
from memo_core.policy.consolidation import Clustering
from memo_core.policy.feedback_processing import FeedbackProcessor, asking_without_a_run
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs.consolidation import calls_without_a_run
from memo_core.runs.factories import book_of, library_of, prompts_of
from memo_core.skillbook import raw_log
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import Feedback


def rebuild_book(
    experiment: Experiment,
    source: Skillbook,
    out: Path,
    method: str,
    memory: Memory,
    until: int | float | None,
    stop: StopSwitch,
    read_backs: bool = True,
    condense_after: Collection[int] = (),
) -> Rebuilt:
    """Make the book of a ``method`` with this ``memory`` in the new file ``out`` from the log of ``source``, which is
    open for writing: it keeps the answers. Nothing is left in ``out`` when it fails. ``read_backs`` False: as if
    nothing had been read back. ``condense_after``: feedback after which the book is clustered, too, where the method
    clusters; it always is at the end. Raises ``MemoError``, ``Stopped``."""
    log = raw_log.raw_log(source, until)
    if not read_backs:
        log = attrs.evolve(log, read_backs=())
    target = book_of(experiment, str(out), read_only=False)
    try:
        with target:
            rebuilding = Rebuilding(log, target, memory, method)
            marks = condense_after if memory.clusters else ()

            def after(said: Feedback) -> None:
                if said.id in marks and said is not log.feedback[-1]:
                    _condense(experiment, source, target, rebuilding, stop, said.time)

            _replay(experiment, source, target, rebuilding, stop, after)
            if memory.clusters:
                _condense(experiment, source, target, rebuilding, stop)
        source.note_place("book", out)
    except BaseException:
        for left in out.parent.glob(out.name + "*"):
            if left.name in (out.name, f"{out.name}-wal", f"{out.name}-shm"):
                left.unlink()
        raise
    return rebuilding.result


def _replay(
    experiment: Experiment,
    source: Skillbook,
    target: Skillbook,
    rebuilding: Rebuilding,
    stop: StopSwitch,
    after: Callable[[Feedback], None],
) -> None:
    model = AnswersOfBook(experiment.choice("llm").create(), source)
    with calls_without_a_run(experiment, model, _ignore, stop, "rebuild") as calls:
        robot, reasks = experiment.create("robot"), experiment.section("run").reasks
        ask = asking_without_a_run(calls, prompts_of(experiment), robot, reasks, experiment.seed)

        def template_of(said: Feedback) -> str | None:
            try:
                code: str = ask("template", said.scene_graph, read_template, subtask=said.subtask, code=said.code)[0]
            except (LanguageModelError, Unreadable):
                return None
            return code

        rebuilding.replay(model, FeedbackProcessor(ask, target, _ignore), template_of, after)


def _condense(
    experiment: Experiment,
    source: Skillbook,
    target: Skillbook,
    rebuilding: Rebuilding,
    stop: StopSwitch,
    when: float | None = None,
) -> None:
    settings = experiment.section("clustering")
    choice: Any = settings.llm if settings.llm is not None else experiment.choice("llm")
    model = AnswersOfBook(choice.create(), source)
    with calls_without_a_run(experiment, model, _ignore, stop, "rebuild") as calls:
        names, prompts = library_of(experiment), prompts_of(experiment)
        clustering = Clustering(target, calls, calls.model, settings, prompts, _ignore, experiment.seed, names=names)
        rebuilding.condense(clustering, model, when)


def _ignore(event: Event) -> None:
    """Ignore the event; the result is in the book."""
