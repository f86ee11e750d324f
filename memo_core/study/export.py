"""Exporting a study: who taught what, without ids and demographics unless they are asked for, and what in the free text
looks personal."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument
from memo_core.interfaces.task import Task
from memo_core.runlog.json_lines import append_line, make_writable
from memo_core.runs.factories import book_of, tasks_of
from memo_core.skillbook import raw_log
from memo_core.study.history import BOOK
from memo_core.study.people import People
from memo_core.study.study import histories_of, journals_of

PERSONAL = {
    "e-mail address": re.compile(r"(?<![\w.+-])[\w.+-]+@[\w-]+\.\w+"),
    "telephone or other long number": re.compile(r"\+?\d[\d ()/-]{5,}\d"),
    "web address": re.compile(r"https?://|www\."),
    "says who somebody is": re.compile(
        r"\b(my name|i am called|i'm called|call me|this is|mr|mrs|ms|dr|prof)\b\.?|\b(i am|i'm)\s+[A-Z]", re.IGNORECASE
    ),
    "speaks of people": re.compile(
        r"\b(my|his|her)\s+(wife|husband|son|daughter|mother|father|brother|sister|boss|colleague|doctor|friend|"
        r"supervisor|professor)\b",
        re.IGNORECASE,
    ),
    "speaks of health or age": re.compile(
        r"\b(my (eyes?|hands?|back|illness|disease|age)|years old|diagnos)", re.IGNORECASE
    ),
}
_CAPITALISED = re.compile(r"(?<![.!?“\"'] )(?<!^)\b[A-Z][a-z]{2,}\b")


def looks_personal(text: str, ids: Iterable[str] = (), known: frozenset[str] = frozenset()) -> list[str]:
    """Why a person should read this before it is published; empty where nothing was found. ``known``: words in lower
    case that are no names (what lies in the scenes)."""
    found = [why for why, pattern in PERSONAL.items() if pattern.search(text)]
    found += [f"the id {one}" for one in ids if re.search(rf"\b{re.escape(one)}\b", text, re.IGNORECASE)]
    names = [word for word in _CAPITALISED.findall(text.strip()) if word.lower() not in known]
    return found + ([f"a name? {', '.join(dict.fromkeys(names))}"] if names else [])


def export_study(experiment: Experiment, study: Path, out: Path, demographics: bool) -> dict[str, int]:
    """Write ``runs.jsonl``, ``remarks.jsonl`` and ``review.jsonl``.

    Args:
        experiment: the study's experiment.
        study: the study's folder.
        out: a new or empty folder for the files.
        demographics: whether ids and ``people.jsonl`` are written too.

    Returns:
        Number of lines of each file.

    Raises:
        InvalidArgument: if ``out`` is not empty.
    """
    if out.exists() and any(out.iterdir()):
        raise InvalidArgument("--to", f"{out} is not empty", "a new folder")
    out.mkdir(parents=True, exist_ok=True)
    counts = {"runs": 0, "remarks": 0, "review": 0}
    people = People(study).all()
    ids = sorted(people)
    known = _words_of(tasks_of(experiment))

    def write(name: str, line: dict[str, Any]) -> None:
        append_line(out / f"{name}.jsonl", line)
        counts[name] += 1

    for name in counts:
        make_writable(out / f"{name}.jsonl")
    for history, journal in zip(histories_of(experiment, study), journals_of(experiment, study), strict=True):
        runs: dict[str, int] = {}
        for run in journal.runs:
            if run.end is None:
                continue
            who = {"participant": run.participant, "session": run.session} if demographics else {}
            told = {key: run.end[key] for key in ("active_s", "success", "corrections", "planning_remarks")}
            write(
                "runs", {"history": history.number, "run": run.number, "task": run.task, "seed": run.seed} | told | who
            )
            runs[_run_id(history.folder / run.folder)] = run.number
        if not (history.folder / BOOK).exists():
            continue
        with book_of(experiment, str(history.folder / BOOK), read_only=True) as book:
            said = raw_log.raw_log(book).feedback
        for one in said:
            where = {"history": history.number, "run": runs.get(one.run), "remark": one.id}
            who = {"participant": one.who} if demographics else {}
            write(
                "remarks",
                where | {"kind": one.kind, "task": one.task, "subtask": one.subtask, "words": one.words} | who,
            )
            if reasons := looks_personal(one.words, ids, known):
                write("review", where | {"words": one.words, "why": reasons})
    if demographics:
        for person, told_of_themselves in people.items():
            append_line(out / "people.jsonl", {"participant": person} | attrs.asdict(told_of_themselves))
    return counts


def _words_of(tasks: Iterable[Task]) -> frozenset[str]:
    """Words of the tasks: none of them is a name."""
    return frozenset(
        word for task in tasks for word in re.findall(r"[a-z]+", f"{task.instruction} {task.lesson}".lower())
    )


def _run_id(folder: Path) -> str:
    from memo_core.runlog.log_file import read_lines

    return str(read_lines(folder).records[0]["run"])
