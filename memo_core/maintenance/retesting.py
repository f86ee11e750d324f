"""Running templates and calls again in a simulator: from the start of the subtask for which they were approved, and in
new scenes of the same task, after running the code of the run's earlier subtasks. They are judged by the task's check
of its subtask (``Task.check_subtask``). What cannot be run or judged gives no trial; the reason is reported."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import attrs

from memo_core.errors import MemoError, Stopped
from memo_core.maintenance.subtask_scene import ProgramOutcome, Stopping, no_signals, subtask_scene
from memo_core.maintenance.template_sources import CannotRetest, TemplateSources, program_of
from memo_core.plugins.registry import Registry
from memo_core.runs.run_errors import RunError, run_error
from memo_core.skillbook import track_record
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import standing_alone
from memo_core.skillbook.model.entries import Entry


@attrs.frozen
class Planned:
    """One planned trial; ``seed`` None: from the stored start."""

    template: Entry  # of a call, with its function and arguments as its text
    start: str  # what the book calls it
    seed: int | None


@attrs.frozen
class Retested:
    """The result of a planned trial. ``success`` None: it could not be made, for ``reason``; ``error`` if robot,
    simulator or the task's code is to blame."""

    template: int
    key: str
    start: str
    success: bool | None
    reason: str = ""
    error: RunError | None = None


class Retesting:
    """Retests the templates and calls of one book. ``stopping`` is a context manager that is entered around everything
    that moves a robot, to handle signals."""

    def __init__(self, book: Skillbook, registry: Registry, stopping: Stopping = no_signals) -> None:
        self._book = book
        self._stopping = stopping
        self._sources = TemplateSources(book, registry)

    def plan(self, templates: Sequence[Entry], seeds: Sequence[int]) -> Iterator[Planned | Retested]:
        """The trials of each template or call: from its stored start and on these seeds; those without a start are
        reported at once."""
        for template in templates:
            template = standing_alone(self._book, template)
            try:
                source = self._sources.of(template)
                program_of(template)
            except CannotRetest as problem:
                yield Retested(template.id, str(template.key), "", None, str(problem))
                continue
            yield Planned(template, source.start_name(None), None)
            for seed in seeds:
                if seed != source.seed:
                    yield Planned(template, source.start_name(seed), seed)

    def run(self, planned: Planned) -> Retested:
        """Make one trial and store it. Raises ``KeyboardInterrupt`` for a stop; this trial is then not stored."""
        template, key = planned.template, str(planned.template.key)
        try:
            outcome = self._tried(template, planned.seed)
        except Stopped:
            raise KeyboardInterrupt from None
        except CannotRetest as problem:
            return Retested(template.id, key, planned.start, None, str(problem))
        except MemoError as problem:
            return Retested(template.id, key, planned.start, None, str(problem), run_error(problem))
        track_record.note_trial(self._book, template.id, planned.start, outcome.success, outcome.reason)
        return Retested(template.id, key, planned.start, outcome.success, outcome.reason)

    def _tried(self, template: Entry, seed: int | None) -> ProgramOutcome:
        """The outcome of the template from one start. Raises ``CannotRetest``, ``Stopped``, ``MemoError``."""
        with subtask_scene(self._sources.of(template), seed, self._stopping) as scene:
            scene.reach_start()
            return scene.judged(program_of(template))
