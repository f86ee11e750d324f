"""The tables of a report, as values: each knows its title, what it was made with, and its cells."""

from __future__ import annotations

import csv
import functools
import io
from collections import Counter
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.evaluation.settings import EMPTY
from memo_core.report.findings import Findings
from memo_core.report.statistics import Interval, Outcomes, difference, interval, probability_of_improvement, wilson
from memo_core.skillbook.model.entries import KINDS

NOT_ABLE = "–"  # cell of a method that declares to have no skillbook, or to take no feedback


@attrs.frozen(eq=False)
class Table:
    """``name`` is its file's; ``note`` says how to read it."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    note: str = ""

    def csv(self) -> str:
        out = io.StringIO()
        writer = csv.writer(out)
        writer.writerow(self.columns)
        writer.writerows([["" if cell is None else cell for cell in row] for row in self.rows])
        return out.getvalue()

    def markdown(self) -> str:
        def line(cells: Sequence[Any]) -> str:
            return "| " + " | ".join("" if cell is None else str(cell).replace("|", "\\|") for cell in cells) + " |"

        head = [f"## {self.title}", "", *([self.note, ""] if self.note else [])]
        return "\n".join([*head, line(self.columns), line(["---"] * len(self.columns)), *map(line, self.rows), ""])


def all_tables(findings: Findings) -> list[Table]:
    """All tables for which there is something."""
    makers = (
        feedback_by_task,
        success_and_corrections,
        success_by_hours,
        success_by_task,
        comparisons,
        floor_and_ceiling,
        books,
        functions,
        retrieval,
        failures,
        ablations,
        given_books,
        given_books_by_task,
        gained_and_lost,
        sessions,
        participants,
    )
    return [table for maker in makers if (table := maker(findings)).rows]


def feedback_by_task(findings: Findings) -> Table:
    names = ("task", "type", "runs", "done", "corrections", "plan_remarks", "notes", "general", "templates")
    rows = [tuple(row[name] for name in names) for row in findings.feedback]
    if rows:
        rows.append(("all", "", *(sum(row[index] for row in rows) for index in range(2, len(names)))))
    note = "All histories together. Notes, general statements and templates: made of what was said in runs of the task."
    return Table("table-1-feedback", "Table I: feedback by task", names, tuple(rows), note)


def success_and_corrections(findings: Findings) -> Table:
    rows = []
    for method in findings.methods:
        zero, watched = findings.compared(method), findings.compared(method, "corrected")
        done = [row for row in watched if row["success"]]
        corrected = (_rate(watched), _number(watched, "corrections"), _number(done, "corrections"))
        rows.append(
            (
                method,
                _hours(zero or watched) if findings.has_memory(method) else NOT_ABLE,
                _rate(zero),
                *(corrected if findings.takes_feedback(method) else [NOT_ABLE] * len(corrected)),
                NOT_ABLE if zero and not any(row["programs"] for row in zero) else _number(zero, "programs"),
                len(zero),
                len(watched) if findings.takes_feedback(method) else NOT_ABLE,
            )
        )
    columns = (
        "method",
        "hours",
        "success zero-shot",
        "success with corrections",
        "corrections a trial",
        "corrections until success",
        "programs zero-shot",
        "trials",
        "watched",
    )
    note = (
        "Largest book of each method, or the only one that it was given. Intervals (95 %): bootstrap over teaching "
        "histories and scenes. Where all trials came out alike it has no width, which does not make the rate "
        "certain. –: the method has no skillbook, takes no feedback, or writes no programs."
    )
    return Table("table-2-success", "Table II: success and corrections", columns, tuple(rows), note)


def success_by_hours(findings: Findings) -> Table:
    rows = []
    for method in findings.methods:
        for hours in (*findings.hours, None):
            chosen = findings.zero_shot(method=method, hours=hours, given="")
            if chosen:
                rows.append((method, "any" if hours is None else f"{hours:g}", _rate(chosen), len(chosen)))
    return Table(
        "figure-4-hours", "Success by hours of teaching", ("method", "hours", "success", "trials"), tuple(rows)
    )


def success_by_task(findings: Findings) -> Table:
    columns = ("task", *findings.methods)
    rows = [
        (
            task,
            *(_rate([row for row in findings.compared(method) if row["task"] == task]) for method in findings.methods),
        )
        for task in findings.tasks
    ]
    return Table("figure-5-tasks", "Success by task, largest or only book, zero-shot", columns, tuple(rows))


def comparisons(findings: Findings) -> Table:
    rows = []
    if "memo" in findings.methods:
        memo = Outcomes.of(findings.largest("memo"))
        for method in findings.methods:
            other = Outcomes.of(findings.largest(method))
            if method == "memo" or not other.trials or not memo.trials:
                continue
            better = interval([memo, other], difference)
            chance = interval([memo, other], probability_of_improvement)
            trials = f"{memo.trials} and {other.trials}"
            rows.append((f"memo - {method}", better.text(unit=" points"), chance.text(1.0, 2, ""), trials))
    note = (
        "Probability of improvement: that a trial of memo comes out better than one of the other; a draw counts half."
    )
    columns = ("compared", "difference of success", "probability of improvement", "trials")
    return Table("comparisons", "Comparisons, largest book, zero-shot", columns, tuple(rows), note)


def floor_and_ceiling(findings: Findings) -> Table:
    rows = []
    for task in findings.tasks:
        without = findings.zero_shot(task=task, method="memo-s")
        untaught = findings.zero_shot(task=task, method="memo", hours=0.0, given="")
        taught = [row for row in findings.largest("memo") if row["task"] == task]
        measured = findings.references.get(task, {})
        reference = f"{measured['reference']} of {measured['scenes']}" if measured else "not measured"
        nothing = f"{measured['nothing']} of {measured['scenes']}" if measured else "not measured"
        rows.append((task, nothing, _rate(without), _rate(untaught), _rate(taught), reference))
    note = "Where an effect can show: between what is reached untaught and what the hand-written reference reaches."
    columns = ("task", "doing nothing", "memo-s", "memo, empty book", "memo, largest book", "reference")
    return Table("floor-and-ceiling", "Floor and ceiling of each task", columns, tuple(rows), note)


def books(findings: Findings) -> Table:
    rows = []
    methods = dict.fromkeys((*findings.methods, *(book["method"] for book in findings.books)))
    for hours in sorted({book["hours"] for book in findings.books}):
        for method in methods:
            of = [b for b in findings.books if b["hours"] == hours and b["method"] == method and not b["ablation"]]
            if of:
                means = [sum(b.get(name, 0) for b in of) / len(of) for name in _COUNTED]
                rows.append((f"{hours:g}", method, of[0]["clustering"], *(f"{mean:.1f}" for mean in means), len(of)))
    columns = ("hours", "method", "clustered", *_COUNTED[:2], *(f"{kind}s" for kind in _COUNTED[2:]), "books")
    without = [method for method in findings.methods if rows and not findings.has_memory(method)]
    rows += [(NOT_ABLE, method, *[NOT_ABLE] * (len(columns) - 2)) for method in without]
    note = "Means over histories. Before clustering: memo-c; after: memo. –: the method has no skillbook."
    return Table("books", "Entries and characters before and after clustering", columns, tuple(rows), note)


_COUNTED = ("entries", "characters", *KINDS)


def functions(findings: Findings) -> Table:
    rows = [
        (
            one["history"],
            one["function"],
            "; ".join(one["calls"]),
            f"{one['replaced']} to {one['characters']}",
            one["tested"],
            one["approved"],
            ", ".join(one["people"]),
            "; ".join(f"“{said}”" for said in one["said"]),
        )
        for one in findings.functions
    ]
    note = "Characters: of the programs that it replaced, and of function and calls."
    columns = ("history", "function", "calls", "characters", "tested", "approved/served", "taught by", "people said")
    return Table("functions", "Functions learnt from programs of several keys", columns, tuple(rows), note)


def retrieval(findings: Findings) -> Table:
    rows = []
    for method in findings.methods:
        chosen = findings.largest(method)
        served = sum(row["served"] for row in chosen)
        irrelevant = sum(row["irrelevant"] for row in chosen)
        if not findings.has_memory(method):
            rows.append((method, *[NOT_ABLE] * 4))
        elif served:
            rows.append(
                (method, served, irrelevant, f"{100 * irrelevant / served:.0f} %", f"{served / len(chosen):.1f}")
            )
    note = (
        "Irrelevant: made at another action on other things than the subtask it was served to. –: the method has no "
        "skillbook."
    )
    columns = ("method", "entries served", "irrelevant", "share", "served a trial")
    shown = tuple(rows) if any(row[1] != NOT_ABLE for row in rows) else ()
    return Table("retrieval", "Irrelevant entries served, largest book, zero-shot", columns, shown, note)


def failures(findings: Findings) -> Table:
    rows = []
    for method in findings.methods:
        failed = [row for row in findings.largest(method) if not row["success"]]
        counted = Counter((row["task"], row["failed_at"], _general(row["why"])) for row in failed)
        example = {(row["task"], row["failed_at"], _general(row["why"])): row["same_as"] for row in failed}
        rows += [(method, *key, count, example[key]) for key, count in counted.most_common()]
    note = "Where: the first subtask whose last code ended with an error; numbers are replaced by #."
    columns = ("method", "task", "where", "why", "trials", "for example")
    return Table("failures", "Where each method failed, largest book, zero-shot", columns, tuple(rows), note)


def ablations(findings: Findings) -> Table:
    names = tuple(dict.fromkeys(row["ablation"] for row in findings.rows if row["ablation"]))
    whole = Outcomes.of(findings.largest("memo")) if "memo" in findings.methods else Outcomes({})
    rows = [("none", _rate(findings.largest("memo")), "", whole.trials)] if names else []
    for name in names:
        changed = Outcomes.of(findings.chosen(ablation=name))
        rows.append(
            (
                name,
                interval([changed]).text(),
                interval([changed, whole], difference).text(unit=" points"),
                changed.trials,
            )
        )
    columns = ("change", "success", "difference to none", "trials")
    return Table("ablations", "Ablations of memo's largest book, zero-shot", columns, tuple(rows))


def given_books(findings: Findings) -> Table:
    keys = dict.fromkeys((row["given"], row["mode"], row["method"]) for row in findings.rows if row["given"])
    rows = []
    for file, mode, method in keys:
        chosen = findings.chosen(given=file, mode=mode, method=method)
        done = [row for row in chosen if row["success"]]
        needed = sum(row.get("lesson_needed", 0) for row in chosen)
        served = sum(row.get("lesson_served", 0) for row in chosen)
        rows.append(
            (
                Path(file).stem,
                method,
                mode,
                _counted(sum(row["success"] for row in chosen), len(chosen)),
                _counted(sum(row.get("first_programs", False) for row in chosen), len(chosen)),
                _number(chosen, "programs"),
                _number(chosen, "attempts"),
                _number(done, "corrections"),
                _number(done, "robot_s"),
                f"{served} of {needed}" if needed else "-",
            )
        )
    columns = (
        "book",
        "method",
        "mode",
        "done",
        "by the first programs",
        "programs a trial",
        "attempts a trial",
        "corrections until success",
        "robot s until success",
        "right lesson served",
    )
    note = (
        "By the first programs: no subtask was done again and no program written anew, so this is what is done with "
        "the robot's own further tries off. Counts with Wilson intervals (95 %), as if trials were independent. Right "
        "lesson served: at the subtasks that need it, something that was said of a training task with the same trick."
    )
    return Table("given-books", "Books that were given", columns, tuple(rows), note)


def gained_and_lost(findings: Findings) -> Table:
    """What a book changed, trial by trial: wrong generalisation shows in what is lost."""
    compared = []
    for method in findings.methods:
        largest = [row for row in findings.largest(method) if row["hours"]]
        compared.append(
            (f"{method}, {_hours(largest)} h", findings.zero_shot(method=method, hours=0.0, given=""), largest)
        )
        for file, mode in dict.fromkeys((row["given"], row["mode"]) for row in findings.rows if row["given"]):
            if file != EMPTY:
                without = findings.chosen(given=EMPTY, method=method, mode=mode)
                with_it = findings.chosen(given=file, method=method, mode=mode)
                compared.append((f"{method}, {Path(file).stem}, {mode}", without, with_it))
    rows = []
    for name, without, with_it in compared:
        before = {_cell(row): row["success"] for row in without}
        both = [row for row in with_it if _cell(row) in before]
        if both:
            gained = [row["task"] for row in both if row["success"] and not before[_cell(row)]]
            lost = [row["task"] for row in both if before[_cell(row)] and not row["success"]]
            tasks = ", ".join(f"{task} ({count})" for task, count in Counter(lost).items())
            rows.append((name, len(both), len(gained), len(lost), tasks))
    columns = ("book", "trials", "gained", "lost", "lost in")
    note = (
        "Each trial beside the one in the same scene with an empty book. Gained: done only with the book. Lost: done "
        "only without it, which is the harm of what was learnt elsewhere."
    )
    return Table("gained-and-lost", "Gained and lost by the book", columns, tuple(rows), note)


def _cell(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["task"], row["scene"], row["number"], row["history"]


def given_books_by_task(findings: Findings) -> Table:
    given = tuple(dict.fromkeys(row["given"] for row in findings.rows if row["given"]))
    rows = []
    for task in findings.tasks:
        for method, mode in dict.fromkeys((row["method"], row["mode"]) for row in findings.rows if row["given"]):
            of = [findings.chosen(given=file, task=task, method=method, mode=mode) for file in given]
            if any(of):
                rows.append((task, method, mode, *(", ".join(_told(row) for row in chosen) for chosen in of)))
    columns = ("task", "method", "mode", *(Path(file).stem for file in given))
    note = (
        "A cell has a trial for each scene: done or not, in brackets how many programs were written, and + where the "
        "right lesson was served."
    )
    return Table("given-books-by-task", "Books that were given, by task", columns, tuple(rows), note)


def _told(row: dict[str, Any]) -> str:
    lesson = " +" if row.get("lesson_served") else ""
    return f"{'done' if row['success'] else 'not done'} ({row['programs']}{lesson})"


def sessions(findings: Findings) -> Table:
    rows = [
        (number, one.number, one.participant, one.runs, f"{one.active_s / 60:.1f}", one.revision)
        for number, journal in enumerate(findings.journals)
        for one in journal.sessions
    ]
    columns = ("history", "session", "participant", "tasks", "minutes", "book's revision")
    return Table("sessions", "Sessions", columns, tuple(rows))


def participants(findings: Findings) -> Table:
    counted = Counter(one.participant for journal in findings.journals for one in journal.sessions)
    minutes: Counter[str] = Counter()
    for journal in findings.journals:
        for one in journal.sessions:
            minutes[one.participant] += round(one.active_s / 60)
    rows = [(who, count, minutes[who]) for who, count in sorted(counted.items())]
    return Table("participants", "Participants", ("participant", "sessions", "minutes"), tuple(rows))


@functools.cache
def said_by_the_paper() -> dict[str, Any]:
    """The paper's figures, as in ``paper_numbers.yaml``."""
    text = resources.files("memo_core.report").joinpath("paper_numbers.yaml").read_text(encoding="utf-8")
    return dict(yaml.safe_load(text))


def rate_of(rows: Sequence[dict[str, Any]]) -> Interval:
    """The success rate of some trials."""
    return interval([Outcomes.of(rows)])


def _rate(rows: Sequence[dict[str, Any]]) -> str:
    """``67 % (33 to 100) of 12``."""
    return f"{rate_of(rows).text()} of {len(rows)}" if rows else "-"


def _counted(successes: int, trials: int) -> str:
    """``10 of 16 (39 to 82 %)``."""
    found = wilson(successes, trials)
    return f"{successes} of {trials} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def _number(rows: Sequence[dict[str, Any]], column: str) -> str:
    return interval([Outcomes.of(rows, column)]).text(1.0, 2, "")


def _hours(rows: Sequence[dict[str, Any]]) -> str:
    """The hours of teaching behind the skillbook, or the name of one that was given."""
    if rows and rows[0]["given"]:
        return Path(rows[0]["given"]).stem
    return f"{rows[0]['hours']:g}" if rows and rows[0]["hours"] is not None else "-"


def _general(why: str) -> str:
    """A reason without its numbers, so that like ones count together."""
    import re

    return re.sub(r"-?\d+(\.\d+)?", "#", why)[:160]
