"""Sources of templates: the run in which it was approved, and the start of its subtask in that run."""

from __future__ import annotations

import ast
import base64
import zlib
from pathlib import Path

import attrs

from memo_core.config import Experiment, load_experiment
from memo_core.errors import InvalidArgument, MemoError
from memo_core.interfaces.task import Task
from memo_core.plugins.registry import Registry
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import History, read_history
from memo_core.runs.factories import task_of
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import program_behind
from memo_core.skillbook.model.entries import Entry, Feedback


class CannotRetest(Exception):
    """A template cannot be run again, or its run cannot be judged, so there is no trial."""


@attrs.frozen(eq=False)
class TemplateSource:
    """The run in which a template was approved. ``start``: checkpoint of the start of its subtask. ``earlier``: the
    subtasks that were approved before it, with their code. ``code``: the approved program."""

    experiment: Experiment
    task: Task
    seed: int
    start: bytes
    earlier: tuple[tuple[str, str], ...]
    subtask: str  # as the planner called it
    run: str
    code: str

    def start_name(self, seed: int | None) -> str:
        """The name of a start in the book: of the stored one for None, else of a new scene with this seed."""
        return f"run {self.run}" if seed is None else f"{self.task.name} seed {seed}"


class TemplateSources:
    """Finds the sources of one book's templates and calls, replaced ones included, and remembers them. A call that
    stands in for a template has the template's."""

    def __init__(self, book: Skillbook, registry: Registry) -> None:
        self._book = book
        self._registry = registry
        self._runs: dict[str, Path] | None = None
        self._sources: dict[int, TemplateSource] = {}

    def of(self, template: Entry) -> TemplateSource:
        """The source of a template or call.

        Raises:
            CannotRetest: if the run or the start of its subtask is not stored, or the run moved hardware.
        """
        if template.id not in self._sources:
            self._sources[template.id] = self._found(template)
        return self._sources[template.id]

    def _found(self, template: Entry) -> TemplateSource:
        approval = self._approval(program_behind(self._book, self._book.entry(template.id)))
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
            experiment,
            task,
            int(history.head["seed"]),
            start,
            tuple(earlier),
            approval.subtask,
            approval.run,
            approval.code,
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
        elif effect.name in ("add a template", "add a call") and effect.about == f"approval {approval}":
            return start
    return None


def program_of(template: Entry) -> str:
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
