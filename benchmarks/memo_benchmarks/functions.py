"""The effect of merging programs into a function on things that were never taught (``memo bench functions``).

Per simulator and seed a simulated teacher teaches the robot to open some things, ``memo cluster`` merges what was
learnt, and each book made of it is used to open other things, with nobody watching. A run ends with its first subtask,
and the task judges that: what comes after the opening would tell about other skills.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import attrs

from memo_benchmarks.demo_sweep import perform_judged
from memo_benchmarks.kept_rows import Row, measured_rows
from memo_core.config import Experiment
from memo_core.demo.running import EMPTY
from memo_core.errors import Stopped
from memo_core.evaluation.lesions import lesioned_copy
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs.consolidation import clustering_of
from memo_core.runs.factories import book_of, task_of
from memo_core.runs.folder import new_run_folder
from memo_core.skillbook.functions import functions_of
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings
from memo_core.text.parsing import parse_json

TAUGHT = ("tabletop:put-the-food-in-the-microwave", "tabletop:open-the-fridge")
THINGS = (  # suite:task
    "tabletop:put-the-food-in-the-oven",
    "tabletop:place-the-apple-on-the-table",
    "families:open-the-wooden-cabinet",
    "families:open-the-wooden-chest",
    "tabletop:put-the-cube-away",
)
NOTHING, UNMERGED, MERGED = "empty", "unmerged", "merged"
BOOKS = {
    NOTHING: "nothing",
    UNMERGED: "as taught",
    MERGED: "after `memo cluster`",
    "function-only": "function, one call",
}
DAMAGED = {  # the merged book under lesions; joined with +, one after the other
    "functions-failing": "merged; the function raises an error",
    "function-only+functions-failing": "function, one call; the function raises an error",
    "calls-shuffled": "merged; each call under the key of the other",
    "no-function-notes": "merged; no notes under the calls' keys",
}
SETTINGS = ("run.video=off", "run.subtasks=1")


@attrs.frozen(eq=False)
class FunctionBench:
    """The measurement in one simulator. ``experiments``: one for each suite, alike but for that."""

    experiments: Mapping[str, Experiment]
    registry: Registry
    out: Path

    def row(self, seed: int, things: Sequence[str], damaged: bool, opened: Callable[[], None]) -> Row:
        """The outcome of one seed, from the folder ``out`` if it is there; ``opened`` is called after each attempt.
        Raises ``Stopped`` when a person ends a run, ``InvalidArgument`` for a folder that cannot be used."""
        names = [*BOOKS, *(DAMAGED if damaged else ())]
        settings = {suite: one.public() for suite, one in self.experiments.items()}
        about = json.dumps([settings, things, names], sort_keys=True, default=str)
        name = f"functions-{hashlib.sha256(about.encode()).hexdigest()[:12]}"
        return measured_rows(self.out, name, seed, 1, lambda _: self._measured(seed, things, names, opened))[0]

    def _measured(self, seed: int, things: Sequence[str], names: Sequence[str], opened: Callable[[], None]) -> Row:
        books = _Books(self.experiments, self.registry, new_run_folder(self.out, "functions", seed), seed)
        corrections = sum(books.teach(task) for task in TAUGHT)
        calls = books.merge()
        openings = []
        for thing in things:
            for book in names:
                openings.append(books.used(thing, book))
                opened()
        return {
            "simulator": books.experiment(things[0]).choice("simulator").backend.name,
            "seed": seed,
            "corrections": corrections,
            "calls": calls,
            "books": {book: books.size(book) for book in names},
            "openings": openings,
            "called": books.characters_called(things[0]),
        }


@attrs.define(eq=False)
class _Books:
    """The books of one seed, files in a folder."""

    experiments: Mapping[str, Experiment]
    registry: Registry
    folder: Path
    seed: int

    def experiment(self, task: str) -> Experiment:
        return attrs.evolve(self.experiments[task.split(":")[0]], seed=self.seed)

    def teach(self, task: str) -> int:
        """The number of corrections that it took."""
        return self._perform(task, UNMERGED, teach=True)[0].result.corrections

    def merge(self) -> list[int]:
        """Do to a copy what ``memo cluster`` does. Returns the number of calls of each function."""
        with (
            closing(sqlite3.connect(self.folder / f"{UNMERGED}.db")) as source,
            closing(sqlite3.connect(self.folder / f"{MERGED}.db")) as copy,
        ):
            source.backup(copy)
        experiment = self.experiment(TAUGHT[0])
        with (
            book_of(experiment, self._url(MERGED), read_only=False) as book,
            clustering_of(experiment, book, lambda event: None, StopSwitch()) as clustering,
        ):
            for _ in clustering.condense_all():
                pass
            return [len(one.calls) for one in functions_of(book)]

    def size(self, book: str) -> dict[str, int]:
        """Its entries and their characters."""
        with book_of(self.experiment(TAUGHT[0]), self._url(book), read_only=True) as opened:
            entries = opened.entries()
        return {"entries": len(entries), "characters": sum(len(entry.text) for entry in entries)}

    def used(self, thing: str, book: str) -> dict[str, Any]:
        """An attempt to open a thing, with characters and tokens of the first question for code."""
        report, opened = self._perform(thing, book)
        characters, tokens = first_prompt(report.folder)
        said = {"why": report.why, "characters": characters, "tokens": tokens}
        return {"thing": thing, "book": book, "opened": opened} | said

    def characters_called(self, thing: str) -> int:
        """Characters of the first question for code with the merged book, as a model that calls functions gets it."""
        return first_prompt(self._perform(thing, MERGED, calls=True)[0].folder)[0]

    def _perform(self, task: str, book: str, teach: bool = False, calls: bool = False) -> tuple[Any, bool]:
        experiment, settings = self.experiment(task), SimulatedTeacherSettings(seed=self.seed, misjudges=0.0)
        name = task.split(":")[1]
        llm: Any = experiment.create("llm")
        if calls:
            llm.calls_functions = True
        report, first = perform_judged(
            experiment,
            self.registry,
            task_of(experiment, name),
            book_of(experiment, self._url(book), read_only=not teach),
            SimulatedTeacher(settings) if teach else None,
            partial(new_run_folder, self.folder, f"{name}-{book}", self.seed),
            llm,
        )
        if report.ended_by_person:
            raise Stopped(f"the run of {name}")
        return report, first is not None and first.success

    def _url(self, book: str) -> str:
        if book == NOTHING:
            return EMPTY
        file = self.folder / f"{book}.db"
        if book not in (UNMERGED, MERGED) and not file.exists():
            before, _, lesion = book.rpartition("+")
            with (
                book_of(self.experiment(TAUGHT[0]), self._url(before or MERGED), read_only=True) as source,
                book_of(self.experiment(TAUGHT[0]), f"sqlite:///{file}", read_only=False) as copy,
            ):
                lesioned_copy(source, copy, lesion, self.seed)
        return f"sqlite:///{file}"


def first_prompt(run: Path) -> tuple[int, int]:
    """Characters and tokens of a run's first question for code; zeros if it did not come to one."""
    for file in sorted((run / "calls").glob("*-code.json")):
        call = parse_json(file.read_text(encoding="utf-8", errors="surrogatepass"))
        usage = (call["answer"] or {}).get("usage") or {}
        return sum(len(message["text"]) for message in call["messages"]), usage.get("prompt_tokens", 0)
    return 0, 0


def measure(
    benches: Sequence[FunctionBench],
    seeds: Sequence[int],
    things: Sequence[str],
    damaged: int,
    progress: Callable[[float], None],
) -> list[Row]:
    """The rows of all simulators and seeds; on the first ``damaged`` seeds with the damaged books. Raises as
    ``FunctionBench.row``."""
    sizes = [len(things) * (len(BOOKS) + (len(DAMAGED) if place < damaged else 0)) for place in range(len(seeds))]
    total, done = len(benches) * sum(sizes), 0
    rows: list[Row] = []
    steps = count(1)

    def opened() -> None:
        progress(next(steps) / total)

    for place, seed in enumerate(seeds):
        for bench in benches:
            rows.append(bench.row(seed, things, place < damaged, opened))
            done += sizes[place]  # a row that was there already called nothing
            steps = count(done + 1)
    return rows


def table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """A line for each book: its size, the prompt, and how often each thing was opened, by simulator."""
    lines = []
    for book, what in (BOOKS | DAMAGED).items():
        openings = [one for row in rows for one in row["openings"] if one["book"] == book]
        if not openings:
            continue
        line: dict[str, Any] = {
            "book": what,
            "entries": _span([row["books"][book]["entries"] for row in rows if book in row["books"]]),
            "characters": _span([row["books"][book]["characters"] for row in rows if book in row["books"]]),
            "prompt, characters": _mean([one["characters"] for one in openings]),
            "prompt, tokens": _mean([one["tokens"] for one in openings]),
        }
        for thing in dict.fromkeys(one["thing"] for one in openings):
            line[f"`{thing.split(':')[1]}`"] = _counts(rows, book, thing)
        lines.append(line)
    return lines


def _counts(rows: Sequence[Row], book: str, thing: str) -> str:
    opened, tried = Counter[str](), Counter[str]()
    for row in rows:
        for one in row["openings"]:
            if (one["book"], one["thing"]) == (book, thing):
                opened[row["simulator"]] += one["opened"]
                tried[row["simulator"]] += 1
    return ", ".join(f"{opened[name]} of {tried[name]}" for name in tried)


def _span(values: Sequence[int]) -> str:
    low, high = min(values), max(values)
    return f"{low}" if low == high else f"{low} to {high}"


def _mean(values: Sequence[int]) -> int:
    return round(sum(values) / len(values))
