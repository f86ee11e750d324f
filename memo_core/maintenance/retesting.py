"""Running templates again in a simulator: from the start of the subtask for which they were approved, and in new scenes
of the same task, after running the code of the run's earlier subtasks. A template is judged by the task's check of its
subtask (``Task.check_subtask``). A template that cannot be run or judged gives no trial; the reason is reported."""

from __future__ import annotations

import ast
import base64
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import attrs

from memo_core.config import Experiment, load_experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.environment.task_verification import run_code
from memo_core.errors import InvalidArgument, MemoError, Stopped
from memo_core.interfaces.link import Link
from memo_core.interfaces.task import Task
from memo_core.plugins.registry import Registry
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import History, read_history
from memo_core.runs.factories import environment_of, sandbox_of, task_of
from memo_core.runs.run_errors import RunError, run_error
from memo_core.runs.sections import SECTIONS
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skillbook import track_record
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import Entry, Feedback


class CannotRetest(Exception):
    """A template cannot be run again, or its run cannot be judged, so there is no trial."""


@attrs.frozen(eq=False)
class TemplateSource:
    """The run in which a template was approved. ``start``: checkpoint of the start of its subtask. ``earlier``: the
    subtasks that were approved before it, with their code."""

    experiment: Experiment
    task: Task
    seed: int
    start: bytes
    earlier: tuple[tuple[str, str], ...]
    subtask: str  # as the planner called it
    run: str


@attrs.frozen
class Planned:
    """One planned trial; ``seed`` None: from the stored start."""

    template: Entry
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
    """Retests the templates of one book. ``stopping`` is a context manager that is entered around everything that moves
    a robot, to handle signals."""

    def __init__(
        self,
        book: Skillbook,
        registry: Registry,
        stopping: Callable[[Link], AbstractContextManager[None]] = lambda link: nullcontext(),
    ) -> None:
        self._book = book
        self._registry = registry
        self._stopping = stopping
        self._runs: dict[str, Path] | None = None
        self._sources: dict[int, TemplateSource] = {}

    def plan(self, templates: Sequence[Entry], seeds: Sequence[int]) -> Iterator[Planned | Retested]:
        """The trials of each template: from its stored start and on these seeds; templates without a start are reported
        at once."""
        for template in templates:
            try:
                source = self._source(template)
                program(template)
            except CannotRetest as problem:
                yield Retested(template.id, str(template.key), "", None, str(problem))
                continue
            yield Planned(template, f"run {source.run}", None)
            for seed in seeds:
                if seed != source.seed:
                    yield Planned(template, f"{source.task.name} seed {seed}", seed)

    def run(self, planned: Planned) -> Retested:
        """Make one trial and store it. Raises ``KeyboardInterrupt`` for a stop; this trial is then not stored."""
        template, source = planned.template, self._source(planned.template)
        key = str(template.key)
        try:
            success, reason = self._tried(template, source, planned.seed)
        except Stopped:
            raise KeyboardInterrupt from None
        except CannotRetest as problem:
            return Retested(template.id, key, planned.start, None, str(problem))
        except MemoError as problem:
            return Retested(template.id, key, planned.start, None, str(problem), run_error(problem))
        track_record.note_trial(self._book, template.id, planned.start, success, reason)
        return Retested(template.id, key, planned.start, success, reason)

    def _tried(self, template: Entry, source: TemplateSource, seed: int | None) -> tuple[bool, str]:
        """Whether the template completed its subtask, and if not, why. Raises ``CannotRetest``, ``MemoError``."""
        world = environment_of(source.experiment, source.task, source.seed if seed is None else seed)
        with world, sandbox_of(source.experiment) as sandbox, self._stopping(world.link):
            if seed is None:
                world.restore(source.start)
            else:
                self._lead(world, sandbox, source)
            return self._judged(world, sandbox, source.subtask, program(template))

    def _lead(self, world: SimulatedEnvironment, sandbox: Sandbox, source: TemplateSource) -> None:
        """Bring a new scene to the start of the subtask."""
        for subtask, code in source.earlier:
            done, why = self._judged(world, sandbox, subtask, code)
            if not done:
                raise CannotRetest(f"its start was not reached: {subtask}, which comes before it, failed ({why})")

    def _judged(self, world: SimulatedEnvironment, sandbox: Sandbox, subtask: str, code: str) -> tuple[bool, str]:
        world.look()
        execution = run_code(world, code, sandbox)
        if execution.ended == "stopped":
            raise Stopped("retesting")
        if not execution.succeeded:
            return False, execution.error or execution.ended
        outcome = world.check_subtask(subtask)
        if outcome is None:
            raise CannotRetest(f"the task {world.task.name} has no check of {subtask}")
        return outcome.success, "" if outcome.success else outcome.reason

    # -- where a template comes from -----------------------------------------------------------------------------------
    def _source(self, template: Entry) -> TemplateSource:
        if template.id not in self._sources:
            self._sources[template.id] = self._found(template)
        return self._sources[template.id]

    def _found(self, template: Entry) -> TemplateSource:
        approval = self._approval(template)
        folder = self._folders().get(approval.run)
        if folder is None:
            raise CannotRetest(f"no start is stored: the folder of the run {approval.run or '(none)'} is not here")
        try:
            history = read_history(folder, read_lines(folder).records)
            start = start_of(history, approval.id)
            experiment = load_experiment(self._registry, folder / "config.yaml", (), SECTIONS)
            if not experiment.create("robot_driver").simulated:
                raise CannotRetest(f"no start is stored: the run {approval.run} moved hardware")
            task = task_of(experiment, str(history.head["task"]))
        except (MemoError, ValueError, KeyError) as error:
            raise CannotRetest(f"no start can be read from {folder}: {error}") from None
        if start is None:
            raise CannotRetest(f"no start is stored: the log of the run {approval.run} has none for it")
        said = [one for one in self._book.feedback_of_run(approval.run) if one.kind == "approval" and one.code]
        earlier: list[tuple[str, str]] = []
        for one in said:
            if one.id >= approval.id:
                break
            if earlier and earlier[-1][0] == one.subtask:
                earlier.pop()  # merged afterwards into one program, which was approved as well
            earlier.append((one.subtask, one.code))
        if earlier and earlier[-1][0] == approval.subtask:
            earlier.pop()
        return TemplateSource(
            experiment, task, int(history.head["seed"]), start, tuple(earlier), approval.subtask, approval.run
        )

    def _approval(self, template: Entry) -> Feedback:
        """The approval that created the template, or, for an edited template, the previous version."""
        sources = [self._book.feedback(number) for number in reversed(self._book.sources([template.id]))]
        approval = next((one for one in sources if one.kind == "approval" and one.run), None)
        if approval is None:
            raise CannotRetest("no start is stored: it was not approved in a run")
        return approval

    def _folders(self) -> dict[str, Path]:
        """The existing folders of the book's runs, by name of the run."""
        if self._runs is None:
            self._runs = {}
            for place in self._book.places():
                if place.kind == "run" and (place.path / "log.jsonl").is_file():
                    try:
                        self._runs[str(read_lines(place.path).records[0].get("run"))] = place.path
                    except InvalidArgument:
                        continue  # damaged: as good as not here
        return self._runs


def start_of(history: History, approval: int) -> bytes | None:
    """The checkpoint of the start of the approved subtask, from a run's log: the first one after its plan. None if the
    log has none, for example on hardware."""
    start, planned = None, False
    for effect in history.replayed:
        if effect.name == "ask a model" and effect.about.startswith("plan "):
            planned = True
        elif effect.name == "execute":
            planned = False
        elif effect.name == "checkpoint" and planned:
            world = (effect.value or {}).get("world")
            start, planned = zlib.decompress(base64.b85decode(world)) if world else None, False
        elif effect.name == "add a template" and effect.about == f"approval {approval}":
            return start
    return None


def program(template: Entry) -> str:
    """The template's code and a call of its function. Parameters without a default are filled with the names of the
    objects of its subtask, in order. Raises ``CannotRetest``."""
    functions = [node for node in ast.parse(template.text).body if isinstance(node, ast.FunctionDef)]
    if not functions:
        raise CannotRetest("it has no function")
    function = functions[-1]
    names = template.key.objects
    needed = len(function.args.posonlyargs) + len(function.args.args) - len(function.args.defaults)
    keywords = [
        arg.arg
        for arg, default in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True)
        if default is None
    ]
    if needed + len(keywords) > len(names):
        raise CannotRetest(f"{function.name} needs more than the names of the things that {template.key} is about")
    given = [repr(name) for name in names[:needed]]
    given += [f"{word}={name!r}" for word, name in zip(keywords, names[needed:], strict=False)]
    return f"{template.text.rstrip()}\n\n\n{function.name}({', '.join(given)})\n"
