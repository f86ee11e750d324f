"""Everything that an experiment's folder holds, gathered for a report."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument
from memo_core.evaluation.books import contents
from memo_core.evaluation.references import read_references
from memo_core.evaluation.table import ERRORS, has_memory, read_table
from memo_core.report.made_with import made_with, method_settings, named
from memo_core.runs.factories import book_of, tasks_of
from memo_core.skillbook.functions import functions_of, record_of
from memo_core.skillbook.model.entries import GLOBAL_KEY
from memo_core.study.history import BOOK
from memo_core.study.journal import Journal
from memo_core.study.people import People
from memo_core.study.study import CONFIG, journals_of, loader, study_sections


@attrs.frozen(eq=False)
class Findings:
    """What was taught, which books came of it, and how trials went."""

    folder: Path
    backend: str  # the language backend that everything was made with
    suite: str
    made_with: str  # all backends that are behind the rates
    settings: dict[str, Any]  # of the evaluation, by section
    study: dict[str, Any]  # the section `study`
    journals: tuple[Journal, ...]
    feedback: tuple[dict[str, Any], ...]  # by task: what was said and what was made of it
    people: dict[str, Any]
    books: tuple[dict[str, Any], ...]
    rows: tuple[dict[str, Any], ...]
    functions: tuple[dict[str, Any], ...]  # learnt in each history, with what stands behind them
    errors: tuple[dict[str, Any], ...]  # trials that could not be carried out: in no rate
    references: dict[str, dict[str, Any]]  # by task: reference solution and doing nothing, where measured

    def zero_shot(self, **wanted: Any) -> list[dict[str, Any]]:
        """Rows of trials that nobody watched, without ablations, with these values."""
        return self.chosen(mode="zero-shot", ablation="", **wanted)

    def corrected(self, **wanted: Any) -> list[dict[str, Any]]:
        """Rows of trials that were watched."""
        return self.chosen(mode="corrected", **wanted)

    def chosen(self, **wanted: Any) -> list[dict[str, Any]]:
        return [row for row in self.rows if all(row[name] == value for name, value in wanted.items())]

    @property
    def methods(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(row["method"] for row in self.rows))

    @property
    def tasks(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(row["task"] for row in self.rows))

    @property
    def hours(self) -> tuple[float, ...]:
        return tuple(sorted({row["hours"] for row in self.rows if row["hours"] is not None}))

    @property
    def method_settings(self) -> dict[str, str]:
        """Settings of the methods that have any, in words."""
        return method_settings(self.settings)

    def has_memory(self, method: str) -> bool:
        """Whether a method has a skillbook."""
        return any(has_memory(row) for row in self.chosen(method=method))

    def takes_feedback(self, method: str) -> bool:
        """Whether a method can be corrected; tables of former versions have only methods that can."""
        return any(row.get("takes_feedback", True) for row in self.chosen(method=method))

    def largest(self, method: str, mode: str = "zero-shot") -> list[dict[str, Any]]:
        """Rows of a method with its largest book; of one without memory, all."""
        rows = self.chosen(method=method, mode=mode, ablation="", given="")
        most = max((row["hours"] for row in rows if row["hours"] is not None), default=None)
        return [row for row in rows if row["hours"] == most]

    def compared(self, method: str, mode: str = "zero-shot") -> list[dict[str, Any]]:
        """Rows that stand for a method beside others: with its largest book, or with the only one that it was given."""
        given = {row["given"] for row in self.chosen(method=method, mode=mode, ablation="")}
        if "" in given or len(given) > 1:
            return self.largest(method, mode)
        return self.chosen(method=method, mode=mode, ablation="")


def gather(registry: Any, folder: Path) -> Findings:
    """Read an experiment's folder; a part that was not done yet is empty. Raises ``InvalidArgument`` where there is
    nothing at all."""
    study, evaluation = folder / "study", folder / "evaluation"
    configs = [file for file in (evaluation / CONFIG, study / CONFIG) if file.exists()]
    if not configs:
        problem = f"{folder} holds neither a study nor an evaluation nor a run"
        raise InvalidArgument(
            "DIR", problem, "the --out of memo study, memo evaluate or memo reproduce, or a run's folder"
        )
    settings = yaml.safe_load(configs[0].read_text(encoding="utf-8"))
    experiment, journals = None, []
    if (study / CONFIG).exists():
        experiment = loader(registry, study / CONFIG, study_sections())()
        journals = journals_of(experiment, study)
    return Findings(
        folder,
        backend=named(settings["llm"]),
        suite=str(settings["suite"]["backend"]),
        made_with=made_with(settings),
        settings=settings,
        study=settings.get("study", {}),
        journals=tuple(journals),
        feedback=tuple(_feedback(experiment, journals)) if experiment is not None else (),
        people={who: attrs.asdict(told) for who, told in People(study).all().items()},
        books=tuple(contents(folder / "books")),
        rows=tuple(read_table(evaluation)),
        functions=tuple(_functions(experiment, journals)) if experiment is not None else (),
        errors=tuple(read_table(evaluation, ERRORS)),
        references=read_references(evaluation),
    )


def _feedback(experiment: Experiment, journals: list[Journal]) -> list[dict[str, Any]]:
    """A row a task: what was said when it was taught, in all histories together, and what was made of it."""
    tasks = {task.name: task for task in tasks_of(experiment)}
    rows: dict[str, dict[str, Any]] = {}
    for journal in journals:
        for run in journal.runs:
            if run.end is None:
                continue
            row = rows.setdefault(run.task, _empty(run.task, tasks[run.task].kind, tasks[run.task].instruction))
            row["runs"] += 1
            row["done"] += bool(run.end["success"])
            row["corrections"] += run.end["corrections"]
            row["plan_remarks"] += run.end["planning_remarks"]
        if (journal.folder / BOOK).exists():
            with book_of(experiment, str(journal.folder / BOOK), read_only=True) as book:
                by_instruction = {row["instruction"]: row for row in rows.values()}
                for entry in book.entries(superseded=True):
                    said = book.feedback(entry.feedback) if entry.feedback is not None else None
                    about = by_instruction.get(said.task) if said is not None else None
                    if about is not None:
                        kind = "general" if entry.key == GLOBAL_KEY else entry.kind
                        about[_MADE[kind]] += 1
    return list(rows.values())


def _functions(experiment: Experiment, journals: list[Journal]) -> Iterator[dict[str, Any]]:
    """A row a function that was learnt: its calls, what they replaced, where it was tested, what people said."""
    for journal in journals:
        if not (journal.folder / BOOK).exists():
            continue
        with book_of(experiment, str(journal.folder / BOOK), read_only=True) as book:
            for one in (record_of(book, learnt) for learnt in functions_of(book)):
                yield {
                    "history": journal.folder.name,
                    "function": one.learnt.function.signature,
                    "calls": [f"{call.key}: {call.text}" for call in one.learnt.calls],
                    "replaced": sum(len(program.text) for program in one.replaced),
                    "characters": sum(len(entry.text) for entry in (one.learnt.entry, *one.learnt.calls)),
                    "tested": one.tested,
                    "people": list(one.people),
                    "said": [said.words for said in one.said if said.words.strip()],
                    "approved": f"{one.learnt.entry.confirmed_uses}/{one.learnt.entry.uses}",
                }


_MADE = {"correction": "notes", "general": "general", "template": "templates", "call": "templates"}


def _empty(task: str, kind: str, instruction: str) -> dict[str, Any]:
    names = ("runs", "done", "corrections", "plan_remarks", "notes", "general", "templates")
    return {"task": task, "type": kind, "instruction": instruction} | dict.fromkeys(names, 0)
