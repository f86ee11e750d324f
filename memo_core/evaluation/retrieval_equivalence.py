"""What a book serves in a trial, kept so that another book can be asked whether it would have served the same.

A run that nobody watches depends on its book through retrieval alone. So if another book gives the same answers to the
same questions, in the same order, a deterministic model and simulator would do the same all over again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attrs
import cattrs

from memo_core.config import Experiment
from memo_core.interfaces.backend import Memory
from memo_core.llm.kept_calls import ASK
from memo_core.runlog.json_lines import append_line, make_writable, read_lines as read_json_lines
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import LogEntry, read_history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.functions import FunctionUse
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.scene_context import SubtaskContext
from memo_core.skillbook.retrieval.result import ALIKE, Retrieval, RetrievedEntry


@attrs.frozen
class Question:
    """What a book was asked in a run, and what the method was then given, as a prompt can tell it apart."""

    subtask: Key
    context: SubtaskContext
    given: str  # JSON


class ObservedBook(Skillbook):
    """A book that notes what it is asked and what it serves to a method with this memory: in ``questions``, and in
    ``file`` before it answers. A run that was cut off goes on with what the file holds; nothing is noted twice."""

    memory: Memory = Memory()

    def observe(self, memory: Memory, file: Path) -> None:
        self.memory, self.file = memory, file
        self.questions = read_questions(file) if file.exists() else []
        make_writable(file)  # a run that asks nothing has a file all the same

    def retrieve(
        self,
        subtask: Key | str,
        context: SubtaskContext | None = None,
        clustered: bool = True,
        functions: FunctionUse = "call",
    ) -> Retrieval:
        found = super().retrieve(subtask, context, clustered, functions)
        key = subtask if isinstance(subtask, Key) else Key.parse(subtask)
        question = Question(key, context or SubtaskContext(), given(found, self.memory))
        if question not in self.questions:
            append_line(self.file, cattrs.unstructure(question))
            self.questions.append(question)
        return found


def observed_book(experiment: Experiment, url: str, memory: Memory, file: Path) -> ObservedBook:
    """A read-only book of the experiment that is observed, unopened."""
    book = ObservedBook(
        url, experiment.create("embedder"), experiment.create("vectorstore"), experiment.section("retrieval"), True
    )
    book.observe(memory, file)
    return book


def given(found: Retrieval, memory: Memory) -> str:
    """What a method gets of a retrieval, without what no prompt shows: ids, scores, names and dates. Of people and
    dates only who is whom and what came before what is kept."""
    parts = (
        found.corrections if memory.corrections else (),
        found.general if memory.general else (),
        found.templates if memory.templates else (),
    )
    calls = tuple(call for function in found.functions if memory.templates for call in function.calls)
    people = list(dict.fromkeys(name for part in (*parts, calls) for one in part for name in one.provenance.who))
    moments = sorted({one.provenance.when for part in (*parts, calls) for one in part})

    def row(one: RetrievedEntry) -> list[Any]:
        who = [people.index(name) for name in one.provenance.who]
        return [one.key, one.text, one.alike, one.passes, who, moments.index(one.provenance.when)]

    functions = [[one.entry.text, *(row(call) for call in one.calls)] for one in found.functions if memory.templates]
    rows: list[list[Any]] = [[row(one) for one in part] for part in parts]
    return json.dumps([*rows, *([functions] if functions else [])], ensure_ascii=False)


def same_answers(
    book: Skillbook, memory: Memory, questions: Sequence[Question], functions: FunctionUse = "call"
) -> bool:
    """Whether a book would give a method the same answers. A method without memory asks nothing and gets nothing."""
    for one in questions:
        found = _NOTHING
        if memory.any:
            found = book.retrieve(one.subtask, one.context, clustered=memory.clusters, functions=functions)
        if given(found, memory) != one.given:
            return False
    return True


_NOTHING = Retrieval(Key("", ()))


def effects_of(run: Path) -> tuple[LogEntry, ...]:
    """What the log of a run in this folder holds."""
    return read_history(run, read_lines(run).records).replayed


def served_in(effects: Sequence[LogEntry]) -> dict[str, int]:
    """How many entries a run was served, and how many of these were made at something else: another action on other
    things, which is called irrelevant here (general statements are about everything and count as neither)."""
    rows = [row for one in effects if one.name == "retrieve" and one.value for row in one.value["served"]]
    return {"served": len(rows), "irrelevant": sum(row["alike"] == ALIKE[3] for row in rows)}


def executed_in(effects: Sequence[LogEntry]) -> int:
    """How many programs were executed in a run."""
    return sum(one.name == "execute" for one in effects)


def programs_in(effects: Sequence[LogEntry]) -> int:
    """How many programs were written in a run: one for each subtask that went well at once."""
    return sum(one.name == ASK and one.about.startswith("code ") for one in effects)


def read_questions(file: Path) -> list[Question]:
    """What a book was asked; a line that was cut off counts as not asked. Raises ``OSError``."""
    return [cattrs.structure(line, Question) for _, line in read_json_lines(file) if line is not None]
